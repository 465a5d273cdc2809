"""Columns of a log: time, drive and displacement, and their units.

A column is found by its title; where that is missing or ambiguous, the caller names it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from numbers import Integral
from typing import TYPE_CHECKING

from .._support.messages import quoted
from .._support.units import known_units, lookup, require, split_unit
from ..errors import DataError, ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Column", "Columns", "is_usual"]

# The roles of columns: their quantities and usual titles.
QUANTITIES = {
    "time": ("time",),
    "drive": ("voltage", "displacement"),
    "displacement": ("displacement",),
}
NAMES = {
    "time": ("time", "t", "timestamp"),
    "drive": ("voltage", "drive", "u", "v", "command", "input", "control", "drive voltage"),
    "displacement": (
        *("displacement", "position", "pos", "x", "y", "output", "sensor", "measured"),
        *("height (measured)", "measured height"),
    ),
}
# Titles of a drive that cannot be a position.
VOLTAGES = ("voltage", "v", "drive voltage")
# Usual titles of a drive that is a position, in logs without a voltage.
POSITIONS = (
    *("height (piezo)", "piezo height", "piezo", "drive", "command", "input", "control"),
    *("setpoint", "set point"),
)
# Usual titles of a reference.
TO_FOLLOW = ("reference", "desired", "target", "setpoint")
# Most columns that a message lists, by their titles, or with units and lengths.
MOST_LISTED, MOST_DESCRIBED = 20, 6
BY_NUMBER = (
    "there is no header line: name the columns by number and give their units, as in "
    "time=0, drive=1, displacement=2, units={0: 's', 1: 'V', 2: 'um'}"
)


@dataclass(frozen=True)
class Column:
    """A column: its number, its title as written, and the title's name and unit.

    In a file with groups of columns the title is a path, as ``run 1/voltage_V``: `group` is what is
    before the last slash, and `last` what is behind it. `count` is the number of samples, where
    columns differ.
    """

    index: int
    title: str
    name: str
    unit: str
    unit_from_caller: bool = False
    group: str = ""
    count: int | None = None
    last: str = ""

    @property
    def keys(self) -> tuple[str, ...]:
        """Names by which a caller may call the column, the surest first."""
        path = f"{self.group}/{self.name}" if self.group else self.name
        return (self.title, path, self.last or self.title, self.name)

    @property
    def described(self) -> str:
        """Title, and unit and number of samples where columns differ in that."""
        if self.count is None:
            return quoted(self.title)
        unit = f" [{self.unit}]" if self.unit and self.last == self.name else ""
        return f"{quoted(self.title)}{unit} ({self.count} samples)"

    def __str__(self) -> str:
        return f"column {quoted(self.title)}" if self.title else f"column {self.index}"


class Columns(list[Column]):
    """The columns of a log in order, made from their titles.

    Its errors do not name the file, which it does not know.
    """

    def __init__(self, titles: Sequence[str], *, has_titles: bool) -> None:
        names = titles if has_titles else [""] * len(titles)
        super().__init__(Column(k, title, *split_unit(title)) for k, title in enumerate(names))
        self.has_titles = has_titles
        # Numbers of those without any reading, which are no candidates.
        self.empty: set[int] = set()
        # What a person should know of the columns, as a unit that is not that of the file.
        self.notes: list[str] = []

    @classmethod
    def of(cls, columns: Sequence[Column], *, has_titles: bool = True) -> Columns:
        """Make a list of columns that are known already."""
        made = cls([], has_titles=has_titles)
        made.extend(columns)
        return made

    def roles(
        self,
        wanted: Mapping[str, str | int | None],
        units: Mapping[str | int, str] | None,
        *,
        needs_time: bool,
        checks_time: bool | None = None,
    ) -> dict[str, Column]:
        """Find the column in each role of `wanted` and see that its unit fits.

        Parameters
        ----------
        wanted : mapping of str to str, int or None
            What the caller names the columns by.
        units : mapping of str or int to str or None
            Units by role or column.
        needs_time : bool
            Whether a column of the time has to be there.
        checks_time : bool, optional
            Whether one that is there is used, so that its unit matters; as `needs_time` by default.

        Returns
        -------
        dict of str to Column
            By role.

        Raises
        ------
        ParameterError
            `wanted` or `units` name a column that is not there, or a unit that does not fit.
        DataError
            A role that the caller does not name has no column or several, or a title has no unit
            or one of another quantity.
        """
        units = {} if units is None else units
        if not isinstance(units, Mapping):
            raise ParameterError("units", quoted(units), "a mapping of columns to units")
        for key, unit in units.items():
            if not isinstance(unit, str):
                raise ParameterError(
                    "units", f"{quoted(unit)} for {quoted(key)}", "text", verb="has"
                )
            if key not in QUANTITIES:
                self._set_unit(self._find(key, "units"), unit)
        roles = {role: self._find(key, role) for role, key in wanted.items() if key is not None}
        missing = [role for role in wanted if role not in roles]
        if any(column.group for column in self):
            # The time last: of several it is that of the group of the others.
            missing.sort(key="time".__eq__)
        for role in missing:
            if role == "time":
                _check_lengths(list(roles.values()))
            columns = self._candidates(role, taken={column.index for column in roles.values()})
            groups = {column.group for column in roles.values()}
            if len(columns) > 1 and len(groups) == 1:
                columns = [column for column in columns if column.group in groups] or columns
            if len(columns) == 1 or role != "time" or needs_time:
                roles[role] = self._only(columns, role)
        roles = {role: roles[role] for role in wanted if role in roles}
        if len({column.index for column in roles.values()}) < len(roles):
            raise ParameterError(
                ", ".join(roles), "the same column twice", "different ones", verb="name"
            )
        for role in roles:
            if role in units:
                roles[role] = self._set_unit(roles[role], units[role])
            if role != "time" or (needs_time if checks_time is None else checks_time):
                _check_unit(roles[role], role)
        return roles

    def to_follow(self) -> int | None:
        """Return the number of the one column that is called a reference, or None."""
        found = [column.index for column in self if column.name.lower() in TO_FOLLOW]
        return found[0] if len(found) == 1 else None

    def _set_unit(self, column: Column, unit: str) -> Column:
        stated = lookup(column.unit)
        if stated is not None and stated != lookup(unit) and not column.unit_from_caller:
            self.notes.append(f"{column}: unit {unit} by units=, {column.unit} in the file")
        self[column.index] = replace(column, unit=unit, unit_from_caller=True)
        return self[column.index]

    def _find(self, key: str | int, argument: str) -> Column:
        """Return the column that the caller names by its title, its name or its number."""
        columns: list[Column] = []
        if isinstance(key, Integral) and not isinstance(key, bool):
            columns = [column for column in self if column.index == key]
        elif isinstance(key, str):
            text = key.strip()
            columns = (
                [column for column in self if text and text == column.keys[0]]
                or [column for column in self if text and text == column.keys[1]]
                or [column for column in self if text and text == column.keys[2]]
                or [column for column in self if text and text == column.keys[3]]
                or [c for c in self if text and text.lower() in map(str.lower, c.keys)]
            )
        if len(columns) == 1:
            return columns[0]
        problem = "is the name of several columns" if columns else "is not a column"
        there = self._nearest(str(key), columns or self)
        names = _titles(there) if self.has_titles else f"0 to {len(self) - 1}, without titles"
        those = "they" if columns else "the columns"
        words = f"{argument}: {quoted(key)} {problem}; {those} are {names}"
        raise ParameterError(words, argument=argument)

    def _nearest(self, key: str, columns: Sequence[Column]) -> Sequence[Column]:
        """Put the columns with names like `key` first, where a message cannot take all."""
        if len(columns) <= _most(columns):
            return columns
        from difflib import get_close_matches

        names = {name.lower(): column for column in columns for name in column.keys}
        near = [names[name] for name in get_close_matches(key.lower(), list(names), n=MOST_LISTED)]
        first = {column.index: column for column in near}
        return [*first.values(), *(column for column in columns if column.index not in first)]

    def _candidates(self, role: str, taken: set[int]) -> list[Column]:
        """Return the columns with a usual name for `role`, those whose unit fits if there are."""
        candidates, fitting, positions = [], [], []
        for column in self:
            name, unit = _plain(column.name), lookup(column.unit)
            fits = unit is not None and unit.quantity == QUANTITIES[role][0]
            if column.index in taken | self.empty:
                continue
            if role == "drive" and name in POSITIONS and (not unit or unit.si == "m"):
                positions.append(column)
            # Without a unit, v is as likely a velocity.
            if name in NAMES[role] and (fits or name != "v"):
                candidates.append(column)
                if fits or unit is None:
                    fitting.append(column)
        return fitting or positions or candidates

    @property
    def _filled(self) -> list[Column]:
        """Those with a reading."""
        return [column for column in self if column.index not in self.empty]

    def _only(self, columns: Sequence[Column], role: str) -> Column:
        if len(columns) == 1:
            return columns[0]
        if not self.has_titles:
            raise DataError(BY_NUMBER)
        if columns:
            several = f"several columns could be the {role}: {_titles(columns)}"
            raise DataError(f"{several}; choose one with {role}=")
        instead = ", or give the sampling interval with dt=" if role == "time" else ""
        nothing = f"no column is known to be the {role}: name it with {role}={instead}"
        raise DataError(f"{nothing}; the columns are {_titles(self._filled)}")


def is_usual(name: str) -> bool:
    """Whether a column of this name may be taken for time, drive or displacement."""
    return any(_plain(name) in names for names in (*NAMES.values(), POSITIONS))


def _plain(name: str) -> str:
    return re.sub(r"[\s_-]+", " ", name).lower()


def _titles(columns: Sequence[Column]) -> str:
    shown = [column.described for column in columns[: _most(columns)]]
    more = len(columns) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more > 0 else "")


def _most(columns: Sequence[Column]) -> int:
    """Return how many columns a message takes: fewer with their units and lengths."""
    return MOST_LISTED if not columns or columns[0].count is None else MOST_DESCRIBED


def _check_lengths(columns: Sequence[Column]) -> None:
    """Refuse columns of several lengths."""
    for first, other in pairwise(columns):
        if first.count != other.count:
            raise DataError(
                f"{first} has {first.count} samples and {other} has {other.count}: expected "
                "equally many"
            )


def _check_unit(column: Column, role: str) -> None:
    is_voltage = role == "drive" and _plain(column.name) in VOLTAGES
    quantities = ("voltage",) if is_voltage else QUANTITIES[role]
    if not column.unit:
        raise DataError(
            f"{column} has no unit: state it in the file, or give it as "
            f"units={{{role!r}: ...}}, one of {known_units(*quantities)}"
        )
    try:
        require(column.unit, *quantities)
    except ParameterError as error:
        kind = ParameterError if column.unit_from_caller else DataError
        raise kind(f"{column}: {error}") from None
