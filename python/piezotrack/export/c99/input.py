"""Input of the control in C: tests of numbers, readings, filters of the measurement."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from .text import Constant, Field, Operations, Part, Setting, Size

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["filters", "numbers", "readings"]

# Numbers from here on enter no state: 1e100 in rust/control, which is no float.
USABLE = {False: 1e100, True: 1e30}
# Largest coefficient of a filter that is stable.
MOST = 4.0


def numbers(limits: tuple[float, float], unit: str, *, single: bool, repeats: bool) -> Part:
    """Make what every part uses: limits, and tests of numbers without a library.

    Parameters
    ----------
    limits : (float, float)
        Lowest and highest command.
    unit : str
        Their unit.
    single : bool
        Whether numbers are floats.
    repeats : bool
        Whether there is a repetitive part, which uses the range of the limits.

    Returns
    -------
    Part
        It comes first.
    """
    low, high = limits
    constants = [
        Constant("LIMITS_LOW", low, f"lowest command, {unit}"),
        Constant("LIMITS_HIGH", high, f"highest command, {unit}"),
        Constant("USABLE", USABLE[single], "numbers from here on enter no state"),
    ]
    if repeats:
        constants.append(Constant("LIMITS_RANGE", high - low, f"range between them, {unit}"))
    return Part(
        file="numbers.c",
        chooses=("SINGLE",) if single else (),
        constants=tuple(constants),
    )


def readings(low: float, high: float, max_jump: float | None) -> Part:
    """Make the test whether a reading is a measurement."""
    jumps = max_jump is not None and math.isfinite(max_jump)
    width = high - low
    constants = [
        Constant("SPAN_LOW", low, "lowest displacement that the sensor can show, m"),
        Constant("SPAN_HIGH", high, "highest one, m"),
        Constant("REFERENCE_LOW", low - width, "a reference below this is none, m"),
        Constant("REFERENCE_HIGH", high + width, "a reference above this is none, m"),
    ]
    fields = [
        Field("count", "refused_not_finite", "readings that were NaN or infinite"),
        Field("count", "refused_outside", "readings outside of the span"),
        Field("count", "refused_jumps", "readings too far from the last valid one"),
    ]
    if jumps:
        assert max_jump is not None
        constants.append(Constant("SPAN_JUMP", max_jump, "largest way in a sample, m"))
        fields += [
            Field("real", "reading_last", "the last valid reading, m"),
            Field("count", "reading_since", "samples since then"),
            Field("flag", "reading_begun", "whether there was one"),
        ]
    return Part(
        file="readings.c",
        chooses=("JUMPS",) if jumps else (),
        constants=tuple(constants),
        fields=tuple(fields),
        operations=Operations(2, 1) if jumps else Operations(),
    )


def filters(coefficients: Sequence[Sequence[float]]) -> Part:
    """Make the filters of the measurement, one after the other."""
    count = len(coefficients)
    flat = [number for one in coefficients for number in one]
    most = max(MOST, *(2.0 * abs(one) for one in flat))
    names = tuple(
        f"filter_{i}_{one}" for i in range(1, count + 1) for one in ("b0", "b1", "b2", "a1", "a2")
    )
    text = "b0, b1, b2, a1, a2 of each filter, one after the other"
    return Part(
        file="filters.c",
        chooses=("FILTERED",),
        sizes=(Size("FILTER_COUNT", count, "filters"),),
        settings=(Setting("FILTERS", flat, text, "1", -most, most, names),),
        fields=(
            Field("real", "filter_memory", "two numbers of each filter, m", 2 * count),
            Field("flag", "filter_begun", "whether it had a measurement", count),
        ),
        operations=Operations(4 * count, 5 * count),
    )
