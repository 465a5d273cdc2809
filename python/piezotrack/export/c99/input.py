"""Input of the control in C: tests of numbers, readings, filters of the measurement."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from .text import Constant, Field, Operations, Part

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["filters", "helpers", "readings"]

# Numbers from here on enter no state: 1e100 in rust/control, which is no float.
USABLE = {False: 1e100, True: 1e30}


def helpers(limits: tuple[float, float], unit: str, others: str, *, single: bool) -> Part:
    """Make what every part uses: limits, and tests of numbers without a library.

    Parameters
    ----------
    limits : (float, float)
        Lowest and highest command.
    unit : str
        Their unit.
    others : str
        The code of all other parts, which tells what of it is needed.
    single : bool
        Whether numbers are floats.

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
    if "LIMITS_RANGE" in others:
        constants.append(Constant("LIMITS_RANGE", high - low, f"range between them, {unit}"))
    used = "".join(text for name, text in OPTIONAL.items() if f"{name}(" in others)
    return Part(
        title="limits, and tests of numbers without a library",
        constants=tuple(constants),
        code=HELPERS.replace("@optional", used),
    )


HELPERS = """\
static real magnitude(real value)
{
    return value < 0 ? -value : value;
}

/* False for NaN and infinity. */
static int is_finite(real value)
{
    const real nothing = value - value;
    return nothing >= 0 && nothing <= 0;
}

/* False for NaN and for numbers that soon overflow. */
static int is_usable(real value)
{
    return magnitude(value) < USABLE;
}
@optional
/* The command within the limits; that nearest to 0 for NaN. */
static real clip(real volts)
{
    const real value = volts < 0 || volts >= 0 ? volts : 0;
    return value < LIMITS_LOW ? LIMITS_LOW : value > LIMITS_HIGH ? LIMITS_HIGH : value;
}
"""
# Functions that some parts use, by their names.
OPTIONAL = {
    "within": """
/* A number within `most` of 0. */
static real within(real value, real most)
{
    return value < -most ? -most : value > most ? most : value;
}
""",
    "not_a_number": """
static real not_a_number(void)
{
    const real zero = 0;
    return zero / zero;
}
""",
}


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
    code = READINGS_JUMPS if jumps else READINGS
    return Part(
        title="which readings are measurements",
        constants=tuple(constants),
        fields=tuple(fields),
        code=COUNT + code,
        operations=Operations(2, 1) if jumps else Operations(),
    )


COUNT = """\
static uint32_t one_more(uint32_t count)
{
    return count < UINT32_MAX ? count + 1u : count;
}

"""
READINGS = """\
/* Whether a reading is a measurement: not NaN, nor overload such as 9.91e37. */
static int readings_accept(NAME_state *s, real reading)
{
    if (reading >= SPAN_LOW && reading <= SPAN_HIGH) {
        return 1;
    }
    if (!is_finite(reading)) {
        s->refused_not_finite = one_more(s->refused_not_finite);
    } else {
        s->refused_outside = one_more(s->refused_outside);
    }
    return 0;
}

static void readings_rest(NAME_state *s)
{
    s->refused_not_finite = 0;
    s->refused_outside = 0;
    s->refused_jumps = 0;
}
"""
READINGS_JUMPS = """\
/* Whether a reading is a measurement: not NaN, nor overload such as 9.91e37, nor a jump. The way
   that is allowed grows with the samples since the last one. */
static int readings_accept(NAME_state *s, real reading)
{
    const int inside = reading >= SPAN_LOW && reading <= SPAN_HIGH;
    const real samples = (real)s->reading_since + 1;
    if (inside && (!s->reading_begun
                   || magnitude(reading - s->reading_last) <= SPAN_JUMP * samples)) {
        s->reading_last = reading;
        s->reading_since = 0;
        s->reading_begun = 1;
        return 1;
    }
    s->reading_since = one_more(s->reading_since);
    if (!is_finite(reading)) {
        s->refused_not_finite = one_more(s->refused_not_finite);
    } else if (!inside) {
        s->refused_outside = one_more(s->refused_outside);
    } else {
        s->refused_jumps = one_more(s->refused_jumps);
    }
    return 0;
}

static void readings_rest(NAME_state *s)
{
    s->refused_not_finite = 0;
    s->refused_outside = 0;
    s->refused_jumps = 0;
    s->reading_last = 0;
    s->reading_since = 0;
    s->reading_begun = 0;
}
"""


def filters(coefficients: Sequence[Sequence[float]]) -> Part:
    """Make the filters of the measurement, one after the other."""
    count = len(coefficients)
    flat = [number for one in coefficients for number in one]
    return Part(
        title=f"{count} filter{'s' if count > 1 else ''} of the measurement",
        constants=(
            Constant("FILTERS", flat, "b0, b1, b2, a1, a2 of each filter, one after the other"),
        ),
        fields=(
            Field("real", "filter_memory", "two numbers of each filter, m", 2 * count),
            Field("flag", "filter_begun", "whether there was a measurement"),
        ),
        code=FILTERS_CODE.replace("@count", str(count)),
        operations=Operations(4 * count, 5 * count),
    )


FILTERS_CODE = """\
/* The filtered measurement; the filters begin in the steady state of the first one. */
static real filters_step(NAME_state *s, real measured)
{
    real value = measured;
    int i;
    for (i = 0; i < @count; i++) {
        const real *c = &FILTERS[5 * i];
        real *memory = &s->filter_memory[2 * i];
        const real in = value;
        if (s->filter_begun) {
            value = c[0] * in + memory[0];
            memory[0] = c[1] * in - c[3] * value + memory[1];
            memory[1] = c[2] * in - c[4] * value;
        } else {
            memory[0] = in - c[0] * in;
            memory[1] = (c[2] - c[4]) * in;
        }
    }
    s->filter_begun = 1;
    return value;
}
"""
