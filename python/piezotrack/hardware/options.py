"""Options of a device's address: the part behind the question mark."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from .._support.messages import quoted
from .._support.units import require
from ..errors import DeviceError, ParameterError
from ..references.parse import numbers_with_unit

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["Options", "required_package"]


class Options:
    """Options of an address, each taken by its name; `done` refuses those that nobody took.

    Parameters
    ----------
    form : str
        The whole address as it should be, for messages.
    given : mapping of str to str
        Texts by name.

    Examples
    --------
    >>> options = Options("ni:...", {"limits": "0..7.5V", "scale": "10um/V"})
    >>> options.span("limits", "voltage"), options.ratio("scale")
    ((0.0, 7.5), 1e-05)
    >>> options.done()
    """

    def __init__(self, form: str, given: Mapping[str, str]) -> None:
        self._form, self._left = form, dict(given)

    def text(self, name: str, default: str | None = None) -> str:
        """Return a text; where there is no default it has to be given."""
        value = self._left.pop(name, None) or default
        if value is None:
            raise ParameterError("device", f"no {name}", self._form, verb="has")
        return value

    def optional(self, name: str) -> str | None:
        """Return a text, or None."""
        return self._left.pop(name, None) or None

    def value(self, name: str, quantity: str, default: float) -> float:
        """Return a number in SI."""
        return self._numbers(name, quantity, "")[0] if name in self._left else default

    def span(
        self, name: str, quantity: str, default: tuple[float, float] | None = None
    ) -> tuple[float, float]:
        """Return two numbers in SI, of ``LOW..HIGH`` and a unit."""
        if name not in self._left and default is not None:
            return default
        low, high = self._numbers(name, quantity, "..")
        return low, high

    def ratio(self, name: str) -> float:
        """Return displacement per volt [m/V], of a number and ``um/V``."""
        text = self.text(name)
        top, slash, bottom = text.partition("/")
        try:
            if not slash:
                raise ParameterError("it has no unit per volt")
            (number,), quantity, join = numbers_with_unit(top)
            if quantity != "displacement" or join:
                raise ParameterError(f"{quoted(top)} is no displacement")
            return float(number / require(bottom, "voltage").to_si(1.0))  # type: ignore[arg-type]
        except ParameterError as error:
            raise self._wrong(name, text, "as in 10um/V", error) from None

    def count(self, name: str, default: int) -> int:
        """Return a whole number."""
        if name not in self._left:
            return default
        number = self._numbers(name, "number", "")[0]
        if not isinstance(number, int):
            raise ParameterError("device", f"{name}={number}", "a whole number", verb="has")
        return number

    def done(self) -> None:
        """Refuse what is left."""
        if self._left:
            raise ParameterError(
                "device",
                f"{quoted(next(iter(self._left)))}, which it does not know",
                self._form,
                verb="has",
            )

    def _numbers(self, name: str, quantity: str, join: str) -> list[float]:
        text = self.text(name)
        form = f"{quantity}, as in LOW..HIGH with its unit" if join else f"{quantity} with its unit"
        try:
            numbers, unit, mark = numbers_with_unit(text)
        except ParameterError as error:
            raise self._wrong(name, text, form, error) from None
        if unit != quantity or mark != join:
            raise self._wrong(name, text, form, None)
        return numbers

    def _wrong(
        self, name: str, text: str, form: str, error: ParameterError | None
    ) -> ParameterError:
        why = "" if error is None else f" ({error})"
        return ParameterError("device", f"{name}={quoted(text)}{why}", form, verb="has")


def required_package(module: str, extra: str, what: str) -> Any:
    """Import a package that an adapter needs, or name the extra that installs it.

    Raises
    ------
    DeviceError
        It is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise DeviceError(
            f"{what} needs {module.partition('.')[0]}, which is not installed: expected pip "
            f"install 'piezotrack[{extra}]'"
        ) from None
