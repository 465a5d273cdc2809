"""Values of options: quantities with units, ranges and names, and the errors of wrong ones."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from difflib import get_close_matches
from math import degrees
from typing import TYPE_CHECKING, Any

import click

from .._support.units import OTHER_UNITS, lookup
from ..errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from click.shell_completion import CompletionItem

    ParamType = click.ParamType[Any]
else:
    ParamType = click.ParamType

__all__ = [
    "ANGLE",
    "DECIBELS",
    "DRIVE",
    "FREQUENCY",
    "GAIN",
    "LENGTH",
    "LOOP_TIME",
    "PERCENT",
    "PLAIN",
    "SLEW",
    "TIME",
    "VOLTAGE",
    "Names",
    "Number",
    "ParamType",
    "Quantity",
    "Ranged",
    "Whole",
    "named",
    "nearest",
    "numbers",
    "parted",
]

BARE = re.compile(r"[-+.\deE]+")
NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:inf|nan))\s*(.*?)\s*")


class Number(float):
    """A number as it was typed, converted to the unit in which its option counts.

    Attributes
    ----------
    unit : str
        The unit typed, in ASCII; empty for a bare number.
    """

    unit: str = ""

    @classmethod
    def of(cls, value: float, unit: str) -> Number:
        """Make one."""
        made = cls(value)
        made.unit = unit
        return made


@dataclass(frozen=True, eq=False)
class Quantity(ParamType):
    """A number with the unit of a quantity.

    Parameters
    ----------
    name : str
        Metavar, as ``TIME``.
    units : dict of str to float
        Units beside those of `quantity`, and their factors.
    quantity : str
        Quantity whose units are taken, as ``"time"``.
    bare : str
        Unit in which a number without one counts; empty where it has to have one.
    least_bare, most_bare : float
        Numbers below the one, and from the other on, are refused without a unit, since they may be
        meant in another.
    example : str
        For errors, as ``"20ms"``.
    """

    name: str
    example: str
    bare: str = ""
    units: dict[str, float] = field(default_factory=dict)
    quantity: str = ""
    least_bare: float = 0.0
    most_bare: float = float("inf")

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> Number:
        """Parse a value of an option."""
        del ctx
        return value if isinstance(value, Number) else self.parse(named(param), str(value))

    def parse(self, option: str, text: str) -> Number:
        """Parse a number with or without its unit."""
        found = NUMBER.fullmatch(text)
        if found is None:
            raise ParameterError(option, f"'{text}'", self._expected, verb="has")
        number, unit = float(found[1]), found[2].replace("\N{MICRO SIGN}", "u")
        unit = unit.replace("\N{GREEK SMALL LETTER MU}", "u")
        if not unit:
            if number == 0.0 or number in (float("inf"), -float("inf")) or number != number:
                return Number.of(number, "")
            if not self.bare or number >= self.most_bare or abs(number) < self.least_bare:
                raise ParameterError(option, f"'{text}'", f"its unit, {self.example}", verb="has")
            return Number.of(number, "")
        if unit in self.units:
            return Number.of(number * self.units[unit], unit)
        known = (OTHER_UNITS.get(unit) or lookup(unit)) if self.quantity else None
        if known is None or known.quantity != self.quantity:
            wanted = f"a {self.quantity}, {self.example}" if self.quantity else self._expected
            raise ParameterError(option, f"'{text}'", wanted, verb="has")
        return Number.of(number * known.factor / known.divisor, known.name)

    @property
    def _expected(self) -> str:
        return (
            f"a number, {self.example}" if self.bare else f"a number and its unit, {self.example}"
        )


TIME = Quantity("TIME", "as 2s or 20ms", "s", quantity="time")
LOOP_TIME = Quantity("TIME", "as 20ms or 20s", "s", quantity="time", most_bare=1.0)
LENGTH = Quantity("LENGTH", "as 20nm or 0.02um", quantity="displacement")
VOLTAGE = Quantity("VOLTAGE", "as 5V", "V", quantity="voltage")
FREQUENCY = Quantity("FREQUENCY", "as 200Hz or 1kHz", "Hz", {"MHz": 1e6}, quantity="frequency")
GAIN = Quantity(
    "GAIN",
    "as 0.03V/um",
    "V/um",
    {"V/um": 1.0, "V/nm": 1e3, "V/mm": 1e-3, "V/m": 1e-6, "um/um": 1.0, "nm/nm": 1.0, "N/um": 1.0},
)
SLEW = Quantity("SLEW", "as 2000V/s", "V/s", {"V/s": 1.0, "V/ms": 1e3, "kV/s": 1e3})
DECIBELS = Quantity("DECIBELS", "as 6dB", "dB", {"dB": 1.0})
# A number up to pi may be in rad.
ANGLE = Quantity(
    "ANGLE",
    "as 30deg or 0.5rad",
    "deg",
    {"deg": 1.0, "\N{DEGREE SIGN}": 1.0, "rad": degrees(1.0)},
    least_bare=3.15,
)
# Its numbers have no unit, and the blank stands for that.
PLAIN = Quantity("NUMBER", "as 0.5", " ")
PERCENT = Quantity("PERCENT", "as 5%", "%", {"%": 1.0})
DRIVE = Quantity(
    "DRIVE",
    "as 75V",
    "V",
    {"V": 1.0, "mV": 1e-3, "kV": 1e3, "um": 1.0, "nm": 1e-3, "mm": 1e3, "N": 1.0},
)


@dataclass(frozen=True, eq=False)
class Ranged(ParamType):
    """Two numbers A:B or A..B of a quantity; a bare first one has the unit of the second.

    Parameters
    ----------
    of : Quantity
        Of both.
    name : str
        Metavar.
    open : bool
        Whether either end may be left out.
    """

    of: Quantity
    name: str
    open: bool = False

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[Number | None, Number | None]:
        """Parse a value of an option."""
        del ctx
        return value if isinstance(value, tuple) else self.parse(named(param), str(value))

    def parse(self, option: str, text: str) -> tuple[Number | None, Number | None]:
        """Parse the two numbers."""
        first, mark, last = parted(text)
        if not mark or (not self.open and not (first and last)):
            raise ParameterError(option, f"'{text}'", f"{self.name}, {self._example}")
        high = self.of.parse(option, last) if last else None
        if first and high is not None and high.unit and BARE.fullmatch(first):
            first += high.unit
        return self.of.parse(option, first) if first else None, high

    @property
    def _example(self) -> str:
        return {"TIME": "as 3:15s", "DRIVE": "as 0:75V"}.get(self.of.name, "as 0.02:0.01")


class Whole(ParamType):
    """A whole number."""

    name = "N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Parse a value of an option."""
        del ctx
        try:
            return int(value)
        except ValueError:
            raise ParameterError(named(param), f"'{value}'", "a whole number", verb="has") from None


@dataclass(frozen=True, eq=False)
class Names(ParamType):
    """One of some names.

    Parameters
    ----------
    known : tuple of str or callable
        The names, or what returns them.
    name : str
        Metavar; empty for the names themselves.
    strict : bool
        Whether others are refused here; they may be those of files.
    """

    known: tuple[str, ...] | Callable[[], Iterable[str]]
    name: str = ""
    strict: bool = True

    @property
    def names(self) -> list[str]:
        """The names."""
        return list(self.known() if callable(self.known) else self.known)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Parse a value of an option."""
        del ctx
        names = self.names
        if self.strict and value not in names:
            near = nearest(str(value), names)
            raise ParameterError(named(param), f"'{value}'", f"one of {', '.join(names)}{near}")
        return str(value)

    def get_metavar(self, param: click.Parameter, ctx: click.Context | None = None) -> str:
        """Return the names, where they are the metavar."""
        del param, ctx
        return self.name or "|".join(self.names)

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Return the names that begin so."""
        from click.shell_completion import CompletionItem

        del ctx, param
        return [CompletionItem(name) for name in self.names if name.startswith(incomplete)]


def nearest(text: str, names: Iterable[str]) -> str:
    """Say which name may be meant."""
    by_lower = {name.lower().lstrip("-"): name for name in names}
    text = text.lower().lstrip("-")
    near = [low for low in by_lower if len(text) > 2 and low.startswith(text)][:1]
    near = near or get_close_matches(text, by_lower, n=1, cutoff=0.7)
    return f"; did you mean {by_lower[near[0]]}?" if near else ""


def numbers(option: str, text: str, of: Quantity) -> list[Number]:
    """Parse numbers between commas; a bare one has the unit of the last."""
    parts = [part.strip() for part in text.split(",")]
    unit = of.parse(option, parts[-1]).unit
    return [of.parse(option, part + unit if BARE.fullmatch(part) else part) for part in parts]


def parted(text: str) -> tuple[str, str, str]:
    """Part a range A:B or A..B as `str.partition` does; without either the mark is empty."""
    # Of three dots one may belong to a number.
    mark = ":" if ":" in text or "..." in text else ".."
    first, found, last = text.partition(mark)
    return first.strip(), found, last.strip()


def named(param: click.Parameter | None) -> str:
    """Return the name of an option or argument as it is typed."""
    if param is None:
        return "value"
    if isinstance(param, click.Argument):
        return param.metavar or param.human_readable_name
    return param.opts[0]
