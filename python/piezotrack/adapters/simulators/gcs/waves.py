"""Wave tables of a virtual controller: the segments that WAV makes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .arguments import Refusal, number_of, whole_of

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["WaveTables"]

# More points than any memory has, so that none is asked for them.
LARGEST = 10_000_000
APPENDS = ("X", "&", "+")


class WaveTables:
    """The wave tables in their common memory.

    Parameters
    ----------
    count : int
        Number of tables.
    points : int
        Points of all tables together.
    """

    def __init__(self, count: int, points: int) -> None:
        self.count, self.points = count, points
        self._tables: dict[int, Array] = {}

    def __getitem__(self, number: int) -> Array:
        return self._tables.get(number, np.empty(0))

    def clear(self, number: int) -> None:
        """Delete a table's points."""
        self._tables.pop(number, None)

    def define(self, number: int, append: str, words: Sequence[str]) -> None:
        """Write a segment: WAV TABLE APPEND TYPE ...; `words` begin with the type."""
        if append not in APPENDS:
            raise Refusal(1)
        kind, *rest = words
        make = SEGMENTS.get(kind.upper())
        if make is None:
            raise Refusal(1)
        old = np.empty(0) if append == "X" else self[number]
        with np.errstate(over="ignore", invalid="ignore"):
            table = self._with(append, old, make(rest, old.size if append == "&" else 0))
        if not np.all(np.isfinite(table)):
            raise Refusal(17)
        others = sum(one.size for key, one in self._tables.items() if key != number)
        if others + table.size > self.points:
            raise Refusal(67)
        self._tables[number] = table

    @staticmethod
    def _with(append: str, old: Array, segment: Array) -> Array:
        """Return a table with another segment: behind it, or added to its points."""
        if append == "+":
            if segment.size > old.size:
                raise Refusal(17)
            table = old.copy()
            table[: segment.size] += segment
            return table
        return np.concatenate([old, segment])


def _points(words: Sequence[str], old: int) -> Array:
    """PNT START COUNT VALUES: points one by one."""
    if len(words) < 3:
        raise Refusal(26)
    start, count = whole_of(words[0]), whole_of(words[1])
    # Appended points may be counted from the table's beginning too.
    if start not in (1, old + 1):
        raise Refusal(17)
    if count != len(words) - 2:
        raise Refusal(24)
    return np.array([number_of(word) for word in words[2:]])


def _placed(words: Sequence[str], extra: int) -> tuple[int, float, float, int, int, list[int]]:
    """SEGMENT AMPLITUDE OFFSET LENGTH START ...: a curve within a segment of its offset."""
    if len(words) != 5 + extra:
        raise Refusal(24)
    segment, length, start = (whole_of(words[k]) for k in (0, 3, 4))
    rest = [whole_of(word) for word in words[5:]]
    amplitude, offset = number_of(words[1]), number_of(words[2])
    if segment > LARGEST:
        raise Refusal(67)
    if segment < 1 or length < 1 or start < 0 or start + length > segment or min(rest) < 0:
        raise Refusal(17)
    return segment, amplitude, offset, length, start, rest


def _filled(segment: int, start: int, curve: Array, after: float, before: float) -> Array:
    out = np.full(segment, before)
    out[start : start + curve.size] = curve
    out[start + curve.size :] = after
    return out


def _line(words: Sequence[str], old: int) -> Array:
    """LIN: from the offset to offset + amplitude, with soft ends."""
    del old
    segment, amplitude, offset, length, start, (ends,) = _placed(words, 1)
    curve = offset + amplitude * _way(length, ends)
    return _filled(segment, start, curve, offset + amplitude, offset)


def _ramp(words: Sequence[str], old: int) -> Array:
    """RAMP: up to the centre point and down again."""
    del old
    segment, amplitude, offset, length, start, (ends, centre) = _placed(words, 2)
    if not 0 < centre < length:
        raise Refusal(17)
    up, down = _way(centre, ends), _way(length - centre, ends)[::-1]
    return _filled(segment, start, offset + amplitude * np.concatenate([up, down]), offset, offset)


def _sine(words: Sequence[str], old: int) -> Array:
    """SIN_P: one period of a cosine, from the offset to offset + amplitude and back."""
    del old
    segment, amplitude, offset, length, start, (centre,) = _placed(words, 1)
    if not 0 < centre < length:
        raise Refusal(17)
    up = 0.5 * np.arange(centre) / centre
    down = 0.5 + 0.5 * np.arange(length - centre) / (length - centre)
    curve = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.concatenate([up, down]))
    return _filled(segment, start, offset + amplitude * curve, offset, offset)


def _way(count: int, ends: int) -> Array:
    """Go from 0 to 1 in `count` points at even speed, but for `ends` points at either end."""
    if 2 * ends > count:
        raise Refusal(17)
    if count == 1:
        return np.zeros(1)
    t = np.arange(count, dtype=np.float64)
    last = count - 1.0
    if not ends:
        return t / last
    # The speed grows evenly through the first points and falls through the last ones.
    speed = np.minimum(1.0, np.minimum((t[:-1] + 0.5) / ends, (last - t[:-1] - 0.5) / ends))
    way: Array = np.concatenate([[0.0], np.cumsum(speed)])
    way /= way[-1]
    return way


SEGMENTS: dict[str, Callable[[Sequence[str], int], Array]] = {
    "PNT": _points,
    "LIN": _line,
    "RAMP": _ramp,
    "SIN_P": _sine,
}
