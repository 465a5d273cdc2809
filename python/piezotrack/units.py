"""The units that logs are written in and plots are drawn in, and the columns that carry them.

Everything inside piezotrack is in seconds, volts and metres. The table here is the one place
where other units are turned into these. A column says by its title what it is and in which
unit; where it does not, or not clearly, the caller has to.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Integral
from typing import TYPE_CHECKING

from .errors import DataError, ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "Column",
    "Columns",
    "Unit",
    "best_length_unit",
    "known_units",
    "lookup",
    "require",
    "split_unit",
]


@dataclass(frozen=True)
class Unit:
    """A unit and the way from it to SI: ``value * factor / divisor``.

    One of `factor` and `divisor` is 1 and the other a number that float64 holds exactly, so a
    conversion rounds once. (1e-6 is not exact: multiplying by it rounds twice.)

    Attributes
    ----------
    name : str
        The unit in ASCII, e.g. ``"um"``.
    quantity : str
        ``"time"``, ``"voltage"`` or ``"displacement"``.
    si : str
        The SI unit of the quantity: ``"s"``, ``"V"`` or ``"m"``.
    factor, divisor : float
        What to multiply with and to divide by.
    """

    name: str
    quantity: str
    si: str
    factor: float = 1.0
    divisor: float = 1.0

    def to_si(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `values`, an array of any shape in this unit, in SI.

        Examples
        --------
        >>> import numpy as np
        >>> from piezotrack.units import require
        >>> require("um").to_si(np.array([45.1]))
        array([4.51e-05])
        """
        converted: NDArray[np.float64] = values * self.factor / self.divisor
        return converted


_TABLE = (
    Unit("s", "time", "s"),
    Unit("ms", "time", "s", divisor=1e3),
    Unit("us", "time", "s", divisor=1e6),
    Unit("ns", "time", "s", divisor=1e9),
    Unit("min", "time", "s", factor=60.0),
    Unit("V", "voltage", "V"),
    Unit("mV", "voltage", "V", divisor=1e3),
    Unit("uV", "voltage", "V", divisor=1e6),
    Unit("kV", "voltage", "V", factor=1e3),
    Unit("m", "displacement", "m"),
    Unit("mm", "displacement", "m", divisor=1e3),
    Unit("um", "displacement", "m", divisor=1e6),
    Unit("nm", "displacement", "m", divisor=1e9),
    Unit("pm", "displacement", "m", divisor=1e12),
)
_BY_NAME = {unit.name: unit for unit in _TABLE} | {
    other: unit for unit in _TABLE if unit.name == "um" for other in ("micron", "microns")
}
_BY_LOWER = {name.lower(): unit for name, unit in _BY_NAME.items()}

# The micro sign and the Greek letter look the same and are different characters.
_MICRO = str.maketrans({"\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u"})


def lookup(text: str) -> Unit | None:
    """Return the unit that `text` names, or None where it names none.

    Upper and lower case may differ from the table only where the text is all of one case and
    cannot mean something else: ``v`` is V and ``UM`` is um, but ``MV`` would be megavolt and
    ``Nm`` is a torque.

    Examples
    --------
    >>> from piezotrack.units import lookup
    >>> lookup("UM").name, lookup("MV"), lookup("furlong")
    ('um', None, None)
    """
    plain = text.strip().translate(_MICRO)
    if plain in _BY_NAME:
        return _BY_NAME[plain]
    unit = _BY_LOWER.get(plain.lower())
    if unit is None or not (plain.islower() or plain.isupper()):
        return None
    is_mega = plain in ("MM", "MS", "MV")
    return None if is_mega else unit


def require(text: str, quantity: str | None = None) -> Unit:
    """Return the unit that `text` names.

    Parameters
    ----------
    text : str
        The unit, e.g. ``"um"``.
    quantity : {"time", "voltage", "displacement"}, optional
        What the unit has to measure; any quantity where left out.

    Raises
    ------
    ParameterError
        The unit is not known, or it measures another quantity. The message lists the known ones.

    Examples
    --------
    >>> from piezotrack.units import require
    >>> require("mV", "voltage").si
    'V'
    """
    unit = lookup(text)
    if unit is None:
        raise ParameterError(f"unknown unit {text!r}: expected one of {known_units(quantity)}")
    if quantity is not None and unit.quantity != quantity:
        raise ParameterError(
            f"{text!r} is a unit of {unit.quantity}: expected a unit of {quantity}, "
            f"one of {known_units(quantity)}"
        )
    return unit


def known_units(quantity: str | None = None) -> str:
    """Return the names of the units of `quantity` (of all where None), separated by commas.

    Examples
    --------
    >>> from piezotrack.units import known_units
    >>> known_units("voltage")
    'V, mV, uV, kV'
    """
    return ", ".join(unit.name for unit in _TABLE if quantity in (None, unit.quantity))


_BRACKETS = re.compile(r"^(.*?)[\s_]*[(\[]([^()\[\]]*)[)\]]$")
_SUFFIX = re.compile(r"^(.+?)[\s_,]+([^\s_,]+)$")


def split_unit(header: str) -> tuple[str, str]:
    """Split the title of a column into its name and the text of its unit.

    A unit in brackets or after a slash is taken as it stands. After an underscore or a space it
    is taken only if it is a known unit: ``sensor_left`` is a name.

    Examples
    --------
    >>> from piezotrack.units import split_unit
    >>> split_unit("voltage_V"), split_unit("Time (s)"), split_unit("x/um")
    (('voltage', 'V'), ('Time', 's'), ('x', 'um'))
    >>> split_unit("sensor_left")
    ('sensor_left', '')
    """
    title = header.strip()
    if match := _BRACKETS.match(title):
        return match[1].strip(), match[2].strip()
    name, slash, unit = title.rpartition("/")
    if slash and name.strip():
        return name.strip(), unit.strip()
    match = _SUFFIX.match(title)
    if match and lookup(match[2]):
        return match[1], match[2]
    return title, ""


def best_length_unit(stroke_m: float) -> tuple[str, float]:
    """Choose the unit in which a displacement is easy to read.

    Parameters
    ----------
    stroke_m : float
        The largest displacement to show [m]; the sign does not matter.

    Returns
    -------
    name : str
        ``"nm"`` below 1 um, ``"mm"`` from 1 mm on, ``"um"`` between them and where `stroke_m`
        is zero or not finite.
    scale : float
        What to multiply metres with to get this unit.

    Examples
    --------
    >>> from piezotrack.units import best_length_unit
    >>> best_length_unit(45e-6)
    ('um', 1000000.0)
    """
    size = abs(stroke_m)
    if not math.isfinite(size) or size == 0.0 or 1e-6 <= size < 1e-3:
        return "um", 1e6
    return ("nm", 1e9) if size < 1e-6 else ("mm", 1e3)


# The roles of columns: what they measure, and what they are usually called.
QUANTITIES = {"time": "time", "drive": "voltage", "displacement": "displacement"}
NAMES = {
    "time": ("time", "t", "timestamp"),
    "drive": ("voltage", "drive", "u", "v", "command", "input", "control", "drive voltage"),
    "displacement": ("displacement", "position", "pos", "x", "y", "output", "sensor", "measured"),
}
BY_NUMBER = (
    "there is no header line: name the columns by number and give their units, as in "
    "time=0, drive=1, displacement=2, units={0: 's', 1: 'V', 2: 'um'}"
)


@dataclass(frozen=True)
class Column:
    """A column: its number, its title as written, and the title's name and unit."""

    index: int
    title: str
    name: str
    unit: str
    unit_from_caller: bool = False

    def __str__(self) -> str:
        return f"column {self.title!r}" if self.title else f"column {self.index}"


class Columns(list[Column]):
    """The columns of a log in order, made from their titles.

    Its errors say nothing of the file, which it does not know.
    """

    def __init__(self, titles: Sequence[str], *, has_titles: bool) -> None:
        names = titles if has_titles else [""] * len(titles)
        super().__init__(Column(k, title, *split_unit(title)) for k, title in enumerate(names))
        self.has_titles = has_titles

    def roles(
        self,
        wanted: Mapping[str, str | int | None],
        units: Mapping[str | int, str] | None,
        *,
        needs_time: bool,
    ) -> dict[str, Column]:
        """Find the column in each role of `wanted` and see that its unit fits.

        Raises
        ------
        ParameterError
            `wanted` or `units` name a column that is not there, or a unit that does not fit.
        DataError
            A role that the caller leaves open has no column or several, or a title has no unit
            or one that does not fit.
        """
        units = {} if units is None else units
        if not isinstance(units, Mapping):
            raise ParameterError(f"units is {units!r}: expected a mapping of columns to units")
        for key, unit in units.items():
            if not isinstance(unit, str):
                raise ParameterError(f"units has {unit!r} for {key!r}: expected text")
            if key not in QUANTITIES:
                self._set_unit(self._find(key, "units"), unit)
        roles = {role: self._find(key, role) for role, key in wanted.items() if key is not None}
        for role in [role for role in wanted if role not in roles]:
            found = self._candidates(role, taken={column.index for column in roles.values()})
            if len(found) == 1 or role != "time" or needs_time:
                roles[role] = self._only(found, role)
        if len({column.index for column in roles.values()}) < len(roles):
            raise ParameterError(f"{', '.join(roles)}: two of them are the same column")
        for role in roles:
            if role in units:
                roles[role] = self._set_unit(roles[role], units[role])
            if role != "time" or needs_time:
                _check_unit(roles[role], role)
        return roles

    def _set_unit(self, column: Column, unit: str) -> Column:
        self[column.index] = replace(column, unit=unit, unit_from_caller=True)
        return self[column.index]

    def _find(self, key: str | int, argument: str) -> Column:
        """Return the column that the caller names by its title, its name or its number."""
        found: list[Column] = []
        if isinstance(key, Integral) and not isinstance(key, bool):
            found = [column for column in self if column.index == key]
        elif isinstance(key, str):
            text = key.strip()
            found = (
                [column for column in self if text and column.title == text]
                or [column for column in self if text and column.name == text]
                or [c for c in self if text and text.lower() in (c.title.lower(), c.name.lower())]
            )
        if len(found) == 1:
            return found[0]
        problem = "is the name of several columns" if found else "is not a column"
        listed = _titles(self) if self.has_titles else f"0 to {len(self) - 1}, without titles"
        raise ParameterError(f"{argument}: {key!r} {problem}; the columns are {listed}")

    def _candidates(self, role: str, taken: set[int]) -> list[Column]:
        """Return the columns with a usual name for `role`, those whose unit fits if there are."""
        found, fitting = [], []
        for column in self:
            name = re.sub(r"[\s_-]+", " ", column.name).lower()
            unit = lookup(column.unit)
            fits = unit is not None and unit.quantity == QUANTITIES[role]
            # Without a unit, v is as likely a velocity.
            if column.index not in taken and name in NAMES[role] and (fits or name != "v"):
                found.append(column)
                if fits or unit is None:
                    fitting.append(column)
        return fitting or found

    def _only(self, found: Sequence[Column], role: str) -> Column:
        if len(found) == 1:
            return found[0]
        if not self.has_titles:
            raise DataError(BY_NUMBER)
        if found:
            several = f"several columns could be the {role}: {_titles(found)}"
            raise DataError(f"{several}; choose one with {role}=")
        nothing = f"no column is known to be the {role}: name it with {role}="
        raise DataError(f"{nothing}; the columns are {_titles(self)}")


def _titles(columns: Sequence[Column]) -> str:
    return ", ".join(repr(column.title) for column in columns)


def _check_unit(column: Column, role: str) -> None:
    quantity = QUANTITIES[role]
    if not column.unit:
        raise DataError(
            f"{column} has no unit: write it into the header, or give it as "
            f"units={{{role!r}: ...}}, one of {known_units(quantity)}"
        )
    try:
        require(column.unit, quantity)
    except ParameterError as error:
        kind = ParameterError if column.unit_from_caller else DataError
        raise kind(f"{column}: {error}") from None
