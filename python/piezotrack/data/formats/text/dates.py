"""Dates in text logs, as seconds from the first sample."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from typing import NamedTuple

__all__ = ["Instant", "instant_of", "is_ambiguous"]

_GERMAN = re.compile(
    r"(\d{1,2})\.(\d{1,2})\.(\d{4})(?:[ T]+(\d{1,2}):(\d{2})(?::(\d{2})(?:[.,](\d{1,9}))?)?)?"
)
_OTHERS = re.compile(r"\d{1,2}[/-]\d{1,2}[/-]\d{2,4}(?:[ T,]|$)|\d{1,2}\.\d{1,2}\.\d{2}(?:[ T,]|$)")
_YEAR_FIRST = re.compile(r"(\d{4})/(\d{2})/(\d{2})(.*)", re.DOTALL)
_CLOCK = re.compile(r"(\d{1,2}):(\d{2}):(\d{2})(?:[.,](\d{1,9}))?")
_FRACTION = re.compile(r"(:\d{2})[.,](\d{1,9})(?=[^\d]*)")


class Instant(NamedTuple):
    """A point in time: one in full seconds, and nanoseconds since."""

    second: datetime
    nanoseconds: int

    def since(self, first: Instant) -> float:
        """Return the time since another instant [s]; TypeError where one lacks the time zone."""
        whole = self.second - first.second
        seconds = 86_400 * whole.days + whole.seconds
        # One rounding, of a whole number of nanoseconds.
        return (10**9 * seconds + self.nanoseconds - first.nanoseconds) / 1e9


def instant_of(text: str) -> Instant | None:
    """Read a date that can be understood in one way only.

    Parameters
    ----------
    text : str
        ISO 8601, ``dd.mm.yyyy hh:mm:ss,fff``, ``yyyy/mm/dd hh:mm:ss`` or a time of day.

    Returns
    -------
    Instant or None
        None where it is none of them.

    Examples
    --------
    >>> first, second = instant_of("2024-03-12T10:00:59.9995"), instant_of("2024-03-12 10:01:00")
    >>> second.since(first)
    0.0005
    >>> instant_of("13.03.2024 10:00:00,25").nanoseconds, instant_of("03/04/2024")
    (250000000, None)
    """
    plain = text.strip()
    if ":" not in plain and "-" not in plain and "." not in plain:
        return None
    try:
        if match := _GERMAN.fullmatch(plain):
            day, month, year, hour, minute, second, fraction = match.groups()
            date = datetime(int(year), int(month), int(day), int(hour or 0), int(minute or 0))
            return Instant(date + timedelta(seconds=_sixty(second)), _nanoseconds(fraction))
        if match := _CLOCK.fullmatch(plain):
            hour, minute, second, fraction = match.groups()
            date = datetime(2000, 1, 1, int(hour), int(minute))
            return Instant(date + timedelta(seconds=_sixty(second)), _nanoseconds(fraction))
        if match := _YEAR_FIRST.fullmatch(plain):
            plain = "{}-{}-{}{}".format(*match.groups())
        match = _FRACTION.search(plain)
        nanoseconds = _nanoseconds(match[2]) if match else 0
        date = datetime.fromisoformat(_FRACTION.sub(r"\1", plain))
    except (ValueError, OverflowError):
        return None
    return Instant(date.astimezone(UTC) if date.tzinfo is not None else date, nanoseconds)


def is_ambiguous(text: str) -> bool:
    """Whether a text is a date in which the day and the month cannot be told apart.

    Examples
    --------
    >>> is_ambiguous("03/04/2024 10:00:00"), is_ambiguous("2024-04-03")
    (True, False)
    """
    return _OTHERS.match(text.strip()) is not None


def _sixty(text: str | None) -> int:
    second = int(text or 0)
    if second > 60:
        raise ValueError
    return second


def _nanoseconds(text: str | None) -> int:
    return int((text or "0").ljust(9, "0"))
