"""A parameter of a problem: held, tied to others, or searched between bounds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Any, Literal, TypeAlias

from ... import _core
from ..._support.arguments import has_entries
from ..._support.messages import quoted
from ...errors import ParameterError

__all__ = ["Parameter", "ParameterEntry", "bounds_of", "parameters_of", "plain_text"]


@dataclass(frozen=True)
class Parameter:
    """Settings of a parameter in `identify`: its value, its bounds or what is known of it.

    A parameter without any of them, ``pt.Parameter()``, is searched between bounds that the record
    gives, also where the model holds it by default, as `b0`, or where the record hardly shows it,
    as the mass.

    Parameters
    ----------
    value : float, optional
        Value at which it is held, SI.
    bounds : (float, float), optional
        Bounds of the search, SI; derived from the record where not given. Where both are positive
        and two decades or more apart, the search is on a logarithmic scale, unless `scale` says
        otherwise.
    scale : {"linear", "log"}, optional
        How the search goes through the bounds; ``"log"`` needs bounds above 0.
    tie : str, optional
        Expression from which it follows, as ``"1.57 * a2"``: numbers, names of parameters,
        ``+ - * / **``, brackets, ``sqrt``, ``exp`` and ``log``, SI. The text is read, never run. It
        may name other tied parameters, but not in a circle.
    prior : (float, float), optional
        Value known besides the record, and its standard deviation, SI. Bounds not given are eight
        standard deviations on either side. See `identify` for what is then minimised.

    Raises
    ------
    ParameterError
        One is of another type. Values, and what does not go together, are refused by `identify`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.Parameter(prior=(2.6e4, 1e3)).prior
    (26000.0, 1000.0)
    """

    value: float | None = None
    _: KW_ONLY
    bounds: tuple[float, float] | None = None
    scale: Literal["linear", "log"] | None = None
    tie: str | None = None
    prior: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.value is not None:
            self._set("value", _core.as_number("value", self.value))
        if self.bounds is not None:
            self._set("bounds", bounds_of("", self.bounds))
        if self.prior is not None:
            self._set("prior", _prior_of(self.prior))
        for name, example in (("scale", "'log'"), ("tie", "'1.57 * a2'")):
            if (text := getattr(self, name)) is None:
                continue
            if not isinstance(text, str):
                raise ParameterError(name, quoted(text), f"a text, as {example}")
            self._set(name, plain_text(text))

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)


ParameterEntry: TypeAlias = float | tuple[float, float] | str | Parameter


def parameters_of(given: object) -> dict[str, Parameter]:
    """Check the parameters of a problem.

    Parameters
    ----------
    given : object
        Mapping of names to numbers, at which they are held; to pairs of bounds; to texts, by which
        they are tied; or to `Parameter`. None for none.

    Returns
    -------
    dict of str to Parameter
        By the same names, which are checked by the core, as values are.

    Raises
    ------
    ParameterError
        It is no mapping, or an entry is none of these.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise ParameterError(
            "parameters",
            quoted(given),
            "a mapping of names to values, bounds, ties or pt.Parameter, as {'mass': 0.18}",
        )
    return {plain_text(str(name)): _parameter(str(name), entry) for name, entry in given.items()}


def _parameter(name: str, entry: Any) -> Parameter:
    """Return the parameter for which an entry stands."""
    if isinstance(entry, Parameter):
        return entry
    if isinstance(entry, str):
        return Parameter(tie=entry)
    if has_entries(entry):
        return Parameter(bounds=bounds_of(name, entry))
    return Parameter(_core.as_number(name, entry))


def bounds_of(name: str, pair: object) -> tuple[float, float]:
    """Check that bounds are two numbers.

    Parameters
    ----------
    name : str
        What has them, for messages; may be empty.
    pair : object
        The bounds.

    Returns
    -------
    (float, float)
        The lower and the upper one.

    Raises
    ------
    ParameterError
        They are not.
    """
    of = f" of {name}" if name else ""
    two = list(pair) if has_entries(pair) else []
    if len(two) != 2:
        raise ParameterError(f"bounds{of}", quoted(pair), "(low, high)", verb="are")
    low, high = two
    return _core.as_number(f"lower bound{of}", low), _core.as_number(f"upper bound{of}", high)


def _prior_of(pair: object) -> tuple[float, float]:
    """Check that a prior is two numbers."""
    two = list(pair) if has_entries(pair) else []
    if len(two) != 2:
        raise ParameterError("prior", quoted(pair), "(value, standard deviation)")
    value, width = two
    return (
        _core.as_number("prior", value),
        _core.as_number("standard deviation of the prior", width),
    )


def plain_text(text: str) -> str:
    """Write half a surrogate pair, which has no place in UTF-8, as an escape."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
