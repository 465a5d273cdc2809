"""Arguments of the commands that a virtual controller is given, and its plain answers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Sequence

__all__ = [
    "AXIS",
    "Refusal",
    "asked_for",
    "axes_of",
    "channel_of",
    "fixed",
    "for_axes",
    "for_channels",
    "none_of",
    "number_of",
    "numbered",
    "pairs_of",
    "parameter_of",
    "plain",
    "range_of",
    "whole_of",
]

# The one axis, and the one channel of its sensor, its output and its wave generator.
AXIS = "1"

# Most digits of a number that is looked at.
LONGEST = 40


class Refusal(Exception):  # noqa: N818
    """A command that the controller refuses.

    Parameters
    ----------
    code : int
        What ERR? answers with.
    """

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


def number_of(word: str) -> float:
    """Read a finite number, or refuse it as one that is none."""
    try:
        value = float(word) if word.isascii() and "_" not in word else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise Refusal(25)
    return value


def whole_of(word: str) -> int:
    """Read a whole number."""
    value = number_of(word)
    if value != int(value) or len(word) > LONGEST:
        raise Refusal(17)
    return int(value)


def parameter_of(word: str) -> int:
    """Read the number of a parameter, decimal or hexadecimal."""
    try:
        return int(word, 16) if word.lower().startswith("0x") else int(word)
    except ValueError:
        raise Refusal(1) from None


def numbered(word: str, count: int, code: int = 17) -> int:
    """Read the number of a channel, generator or table, 1 to `count`."""
    value = whole_of(word)
    if not 1 <= value <= count:
        raise Refusal(code)
    return value


def pairs_of(words: Sequence[str], size: int = 2) -> list[tuple[str, ...]]:
    """Split arguments into groups: an axis and its value, a table with source and option."""
    if not words:
        raise Refusal(26)
    if len(words) % size:
        raise Refusal(24)
    groups = [tuple(words[k : k + size]) for k in range(0, len(words), size)]
    if len({group[0] for group in groups}) < len(groups):
        raise Refusal(22)
    return groups


def asked_for(words: Sequence[str], known: Collection[str], code: int = 15) -> list[str]:
    """Return which items a query is about: those that it names, or all."""
    if any(word not in known for word in words):
        raise Refusal(code)
    return list(words) or list(known)


def none_of(words: Sequence[str]) -> None:
    """Refuse arguments where there are none."""
    if words:
        raise Refusal(24)


def axes_of(words: Iterable[str]) -> None:
    """Refuse axes other than the one there is."""
    if any(word != AXIS for word in words):
        raise Refusal(15)


def channel_of(word: str) -> None:
    """Refuse a channel or a wave generator other than the one there is."""
    if word != AXIS:
        raise Refusal(17)


def fixed(words: Sequence[str], answer: str) -> list[str]:
    """Answer a query without arguments."""
    none_of(words)
    return [answer]


def for_axes(words: Sequence[str], value: str) -> list[str]:
    """Answer a query about axes."""
    return [f"{one}={value}" for one in asked_for(words, [AXIS])]


def for_channels(words: Sequence[str], value: str) -> list[str]:
    """Answer a query about channels or generators."""
    return [f"{one}={value}" for one in asked_for(words, [AXIS], 17)]


def plain(value: float) -> str:
    """Write a number as the answers have it."""
    return f"{value:.9g}"


def range_of(words: Sequence[str], count: int, code: int = 17) -> tuple[int, int | None, list[int]]:
    """Read START COUNT TABLES: the first sample from 0 on, the number, None for all, the tables."""
    if not words:
        return 0, None, []
    if len(words) < 2:
        raise Refusal(26)
    first = whole_of(words[0])
    if first < 1:
        raise Refusal(17)
    return first - 1, whole_of(words[1]), [numbered(word, count, code) for word in words[2:]]
