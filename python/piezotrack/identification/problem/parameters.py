"""Arguments of `identify` on its parameters: scales, ties, inequalities and priors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ... import _core
from ..._support.arguments import has_entries
from ..._support.messages import quoted
from ...errors import ParameterError

__all__ = ["ON_PARAMETERS", "ParameterArguments"]

# Names of the arguments.
ON_PARAMETERS = ("scales", "ties", "constraints", "priors")


@dataclass(frozen=True)
class ParameterArguments:
    """What a caller says of parameters besides values and bounds, as the core takes it.

    Attributes
    ----------
    scales, ties : list of (str, str)
        Names with scales, and with expressions.
    constraints : list of str
        Inequalities.
    priors : list of (str, (float, float))
        Names with values and standard deviations, SI.
    """

    scales: list[tuple[str, str]]
    ties: list[tuple[str, str]]
    constraints: list[str]
    priors: list[tuple[str, tuple[float, float]]]

    @classmethod
    def checked(
        cls, scales: object, ties: object, constraints: object, priors: object
    ) -> ParameterArguments:
        """Check the types; None stands for nothing.

        Parameters
        ----------
        scales, ties, constraints, priors : object
            As for `identify`.

        Returns
        -------
        ParameterArguments
            With texts and numbers; names and texts are checked by the core.

        Raises
        ------
        ParameterError
            One is of another type.
        """
        return cls(
            scales=_texts("scales", "scale", scales, "{'mass': 'log'}"),
            ties=_texts("ties", "tie", ties, "{'b1': '1.57 * a2'}"),
            constraints=_inequalities(constraints),
            priors=[
                (name, _value_and_width(name, pair))
                for name, pair in _items("priors", priors, "{'stiffness': (2.6e4, 1e3)}")
            ],
        )

    @property
    def named(self) -> set[str]:
        """Parameters that are searched, or tied, because of this."""
        return {name for name, _ in (*self.scales, *self.ties, *self.priors)}

    @property
    def core(self) -> dict[str, Any]:
        """Arguments of the core's search."""
        return {name: getattr(self, name) for name in ON_PARAMETERS}


def _items(argument: str, mapping: object, example: str) -> list[tuple[str, Any]]:
    if mapping is None:
        return []
    if not isinstance(mapping, Mapping):
        raise ParameterError(
            f"{argument} is {quoted(mapping)}: expected a mapping of names, as {example}"
        )
    return [(_plain(str(name)), value) for name, value in mapping.items()]


def _texts(argument: str, one: str, mapping: object, example: str) -> list[tuple[str, str]]:
    found = _items(argument, mapping, example)
    for name, text in found:
        if not isinstance(text, str):
            raise ParameterError(
                f"{one} of {name} is {quoted(text)}: expected a text, as in {example}"
            )
    return [(name, _plain(text)) for name, text in found]


def _inequalities(constraints: object) -> list[str]:
    if constraints is None:
        return []
    if not has_entries(constraints):
        raise ParameterError(
            f"constraints is {quoted(constraints)}: expected texts in a list, as ['a2 < b1']"
        )
    texts = list(constraints)
    for text in texts:
        if not isinstance(text, str):
            raise ParameterError(f"constraint is {quoted(text)}: expected a text, as 'a2 < b1'")
    return [_plain(text) for text in texts]


def _value_and_width(name: str, pair: object) -> tuple[float, float]:
    two = list(pair) if has_entries(pair) else []
    if len(two) != 2:
        raise ParameterError(
            f"prior of {name} is {quoted(pair)}: expected (value, standard deviation)"
        )
    return (
        _core.as_number(f"prior of {name}", two[0]),
        _core.as_number(f"standard deviation of the prior of {name}", two[1]),
    )


def _plain(text: str) -> str:
    """Write half a surrogate pair, which has no place in UTF-8, as an escape."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")
