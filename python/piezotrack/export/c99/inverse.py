"""The feedforward in C: a table of one period, or the inverse of a Dahl stage sample by sample."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING

from .dahl import along_operations, dahl_operator
from .text import Constant, Field, Operations, Part

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["dahl_inverse", "voltage_table"]

# As in rust/control/src/inverse: terms of the series, pieces of a way.
TERMS = 4
MOST_PIECES = 2000.0


def voltage_table(voltages: Sequence[float], unit: str) -> Part:
    """Make a feedforward that is played from a table of one period."""
    count = len(voltages)
    return Part(
        title=f"feedforward from a table of one period, {count} samples",
        constants=(Constant("TABLE", voltages, f"feedforward of one period, {unit}"),),
        fields=(
            Field("count", "place", "sample of the table that is played next: set it to shift"),
        ),
        code=TABLE_CODE.replace("@count", f"{count}u"),
    )


TABLE_CODE = """\
static real table_step(NAME_state *s)
{
    const uint32_t place = s->place < @count ? s->place : 0u;
    s->place = place + 1u < @count ? place + 1u : 0u;
    return TABLE[place];
}
"""


def dahl_inverse(
    numbers: Sequence[float], dt: float, offset: float, delay: float, unit: str, *, single: bool
) -> Part:
    """Make the inverse of a Dahl stage, with offset and delay of its sensor."""
    inertia, damping, stiffness, level, friction, a1, a2, gain, piece = numbers
    along, constants = dahl_operator("inverse", TERMS, (a1, a2, gain))
    largest = 3e38 if single else sys.float_info.max
    longest = piece if math.isfinite(piece) else largest
    delayed = delay > 0.0
    delays = [
        Constant("INVERSE_INERTIA", inertia, f"M/T, {unit} s^2/m"),
        Constant("INVERSE_DAMPING", damping, f"D/T, {unit} s/m"),
        Constant("INVERSE_STIFFNESS", stiffness, f"K/T, {unit}/m"),
        Constant("INVERSE_LEVEL", level, f"b1/T, {unit} for one unit of the force"),
        Constant("INVERSE_FRICTION", friction, f"b0/T, {unit} for one unit of the slope"),
        Constant("INVERSE_PIECE", longest, "longest way in one piece, m"),
        Constant("INVERSE_LONGEST", min(MOST_PIECES * longest, largest), "longest way, m"),
        Constant("DRIVE_SAME", 2.0**-21 if single else 2.0**-40, "difference that counts as none"),
        Constant("REFERENCE_DT", dt, "Ts, s"),
        Constant("REFERENCE_DT_SQUARED", dt * dt, "Ts^2, s^2"),
        Constant("REFERENCE_OFFSET", offset, "reading of the sensor at rest, m"),
    ]
    if delayed:
        delays.append(Constant("REFERENCE_DELAY", delay, "delay that is compensated, s"))
        delays.append(Constant("REFERENCE_HALF_DELAY", 0.5 * delay, "half of it, s"))
    code = "".join((_root(single=single), along, STEP_CODE, REMEMBER_CODE, ONLINE_CODE))
    code = code.replace("@x", AHEAD if delayed else NOW)
    code = code.replace("@v", "v + REFERENCE_DELAY * a" if delayed else "v")
    ahead = Operations(4, 3) if delayed else Operations()
    return Part(
        title="feedforward: inverse of a Dahl stage, sample by sample",
        constants=(*delays, *constants),
        fields=(
            Field("inverse", "inverse", "state of the inverse"),
            Field("inverse", "before", "the same before the last sample"),
            Field("real", "target", "displacement, velocity, acceleration of the sample", 3),
            Field("real", "off", "deviation of the stage from the reference, and its velocity", 2),
            Field("real", "off_before", "the same a sample before", 2),
            Field("real", "past", "the last two references, m", 2),
            Field("flag", "has_target", "whether the target is finite"),
            Field("flag", "has_past", "whether there was a reference"),
        ),
        code=code,
        operations=ahead + along_operations(TERMS) + Operations(9, 12, 2),
    )


NOW = "reference - REFERENCE_OFFSET"
AHEAD = "reference + REFERENCE_DELAY * (v + REFERENCE_HALF_DELAY * a) - REFERENCE_OFFSET"


def _root(*, single: bool) -> str:
    """Make a square root that is rounded correctly, digit by digit, as no library is used."""
    # Bits of the mantissa that are stored, of the exponent's bias, and the type of that size.
    stored, bias, bits = (23, 127, "uint32_t") if single else (52, 1023, "uint64_t")
    sizes = {
        "@bits": bits,
        "@stored": str(stored),
        "@bias": str(bias),
        "@rounds": str(stored + 2),
        "@top": str(2 * stored + 2),
        "@shift": str(stored + 2),
    }
    code = ROOT_CODE
    for key, size in sizes.items():
        code = code.replace(key, size)
    return code


ROOT_CODE = """\
/* The square root, rounded correctly: its binary digits one after the other. */
static real square_root(real x)
{
    union { real value; @bits bits; } number;
    @bits mantissa;
    @bits root = 0;
    @bits rest = 0;
    int exponent, i;
    if (!(x > 0) || !is_finite(x)) {
        return x < 0 ? (real)0 / (x - x) : x;
    }
    number.value = x;
    exponent = (int)(number.bits >> @stored);
    mantissa = number.bits & (((@bits)1 << @stored) - 1);
    if (exponent == 0) {
        for (exponent = 1; !(mantissa >> @stored); exponent--) {
            mantissa <<= 1;
        }
    }
    mantissa |= (@bits)1 << @stored;
    exponent -= @bias;
    if (exponent % 2 != 0) {
        mantissa <<= 1;
        exponent -= 1;
    }
    for (i = 0; i < @rounds; i++) {
        const int place = @top - 2 * i;
        const @bits pair = place >= @shift ? (mantissa >> (place - @shift)) & 3 : 0;
        rest = (rest << 2) | pair;
        root <<= 1;
        if (rest >= 2 * root + 1) {
            rest -= 2 * root + 1;
            root |= 1;
        }
    }
    root = (root >> 1) + (root & 1);
    number.bits = ((@bits)(exponent / 2 + @bias) << @stored) + (root - ((@bits)1 << @stored));
    return number.value;
}

"""

STEP_CODE = """\

/* The operator after a monotone way; 0 where that is too long. */
static int inverse_travel(NAME_inverse *at, real distance)
{
    const real direction = distance < 0 ? -1 : 1;
    real left = magnitude(distance);
    if (!(left > INVERSE_PIECE)) {
        inverse_along(&at->force, &at->slope, direction, distance);
        return 1;
    }
    if (left > INVERSE_LONGEST) {
        return 0;
    }
    while (left > INVERSE_PIECE) {
        inverse_along(&at->force, &at->slope, direction, direction * INVERSE_PIECE);
        left -= INVERSE_PIECE;
    }
    inverse_along(&at->force, &at->slope, direction, direction * left);
    return 1;
}

/* Whether the cubic with these end velocities rises without a turn. */
static int is_straight(real w0, real rise, real w1)
{
    const real steepest = 3 * magnitude(rise);
    return w0 * rise >= 0 && w1 * rise >= 0 && magnitude(w0) <= steepest
        && magnitude(w1) <= steepest;
}

/* Along the cubic that turns, from turning point to turning point. */
static int inverse_travel_turning(NAME_inverse *at, real w0, real rise, real w1)
{
    const real c3 = w0 + w1 - 2 * rise;
    const real c2 = rise - w0 - c3;
    const real root = square_root(c2 * c2 - 3 * c3 * w0);
    const real q = -(c2 + (c2 < 0 ? -root : root));
    const real a = q / (3 * c3);
    const real b = w0 / q;
    real turn[2];
    real here = 0;
    int i;
    turn[0] = a < b ? a : b;
    turn[1] = a < b ? b : a;
    for (i = 0; i < 2; i++) {
        real leg = 0;
        if (turn[i] > 0 && turn[i] < 1) {
            const real there = turn[i] * (w0 + turn[i] * (c2 + turn[i] * c3));
            leg = there - here;
            here = there;
        }
        if (!inverse_travel(at, leg)) {
            return 0;
        }
    }
    return inverse_travel(at, rise - here);
}

/* The voltage for displacement, velocity and acceleration; NaN, and nothing changed, without it. */
static real inverse_step(NAME_inverse *state, real x, real v, real a)
{
    NAME_inverse at = *state;
    const real rise = x - at.x;
    const real w = v * REFERENCE_DT;
    real volts, sign;
    int found;
    if (!(is_usable(x) && is_usable(v) && is_usable(a))) {
        return not_a_number();
    }
    if (at.begun && !is_straight(at.w, rise, w)) {
        found = inverse_travel_turning(&at, at.w, rise, w);
    } else {
        found = inverse_travel(&at, rise);
    }
    if (!found) {
        return not_a_number();
    }
    sign = v > 0 ? 1 : v < 0 ? -1 : 0;
    volts = (INVERSE_INERTIA * a + INVERSE_DAMPING * v + INVERSE_STIFFNESS * x)
        + (INVERSE_LEVEL * at.force + sign * INVERSE_FRICTION * at.slope);
    if (!is_finite(volts)) {
        return not_a_number();
    }
    at.x = x;
    at.w = w;
    at.begun = 1;
    *state = at;
    return volts;
}
"""

REMEMBER_CODE = """\

/* What the inverse gives where the stage went another way than the reference, by `way`, less the
   voltage that the stage got. */
static real inverse_excess(const NAME_state *s, real way, real volts, NAME_inverse *after)
{
    const real faster = way / REFERENCE_DT;
    *after = s->before;
    return inverse_step(after, s->target[0] + s->off_before[0] + way, s->target[1] + faster,
                        s->target[2] + (faster - s->off_before[1]) / REFERENCE_DT) - volts;
}

/* Remembers the voltage that the stage got in place of the last one: finds the way for which the
   inverse gives it, by false position with the weights of the Illinois rule (Dowell and Jarratt
   1971), from beyond the step of Newton's method. The inverse is evaluated 42 times at most, some 8
   times mostly. */
static void inverse_remember(NAME_state *s, real volts)
{
    NAME_inverse after;
    NAME_inverse kept;
    real outside, inside, far, near, way, same;
    int above, side;
    int found = 0;
    int last = -1;
    int i;
    if (!s->has_target) {
        return;
    }
    outside = 0;
    inside = 0;
    far = inverse_excess(s, 0, volts, &kept);
    near = far;
    same = DRIVE_SAME * (magnitude(far + volts) + magnitude(volts));
    above = far > 0;
    way = -far * PROBE / (inverse_excess(s, PROBE, volts, &after) - far);
    way = magnitude(way) > 0 && is_finite(way) ? (real)1.25 * way : PROBE;
    for (i = 0; i < 8 && !found; i++) {
        for (side = 0; side < 2 && !found; side++) {
            const real place = side == 0 ? way : -way;
            const real excess = inverse_excess(s, place, volts, &after);
            if (is_finite(excess) && (excess > 0) != above) {
                inside = place;
                near = excess;
                kept = after;
                found = 1;
            }
        }
        way *= 4;
    }
    if (!found) {
        return;
    }
    found = magnitude(near) <= same;
    for (i = 0; i < 24 && !found; i++) {
        const real crossing = outside - far * (inside - outside) / (near - far);
        const int lies = (crossing > outside && crossing < inside)
            || (crossing < outside && crossing > inside);
        const real place = lies ? crossing : (real)0.5 * (outside + inside);
        const real excess = inverse_excess(s, place, volts, &after);
        const int beyond = (excess > 0) == above || excess != excess;
        if (magnitude(excess) <= same) {
            inside = place;
            kept = after;
            found = 1;
        } else if (beyond) {
            outside = place;
            far = excess;
            if (last == 1) {
                near *= (real)0.5;
            }
        } else {
            inside = place;
            near = excess;
            kept = after;
            if (last == 0) {
                far *= (real)0.5;
            }
        }
        last = beyond;
    }
    s->inverse = kept;
    s->off[0] = s->off_before[0] + inside;
    s->off[1] = inside / REFERENCE_DT;
}
""".replace("PROBE", "(real)1e-9")

ONLINE_CODE = """\

static void inverse_rest(NAME_state *s)
{
    int i;
    s->inverse.x = 0;
    s->inverse.w = 0;
    s->inverse.force = 0;
    s->inverse.slope = 0;
    s->inverse.begun = 0;
    s->before = s->inverse;
    for (i = 0; i < 3; i++) {
        s->target[i] = 0;
    }
    for (i = 0; i < 2; i++) {
        s->off[i] = 0;
        s->off_before[i] = 0;
        s->past[i] = 0;
    }
    s->has_target = 0;
    s->has_past = 0;
}

/* The feedforward for the next sample of the reference, which is `next` one sample later: central
   differences, or backward ones where `next` is not a number. */
static real online_step(NAME_state *s, real reference, real next)
{
    const real first = s->has_past ? s->past[0] : reference;
    const real before = s->has_past ? s->past[1] : reference;
    const int ahead = next == next;
    const real v = ahead ? (real)0.5 * (next - before) / REFERENCE_DT
                         : (reference - before) / REFERENCE_DT;
    const real a = ahead ? (next - 2 * reference + before) / REFERENCE_DT_SQUARED
                         : (reference - 2 * before + first) / REFERENCE_DT_SQUARED;
    real drive;
    s->before = s->inverse;
    s->off_before[0] = s->off[0];
    s->off_before[1] = s->off[1];
    s->off[0] = 0;
    s->off[1] = 0;
    s->target[0] = @x;
    s->target[1] = @v;
    s->target[2] = a;
    s->has_target = is_finite(s->target[0]) && is_finite(s->target[1]) && is_finite(a);
    drive = inverse_step(&s->inverse, s->target[0], s->target[1], a);
    if (is_finite(reference)) {
        s->past[0] = before;
        s->past[1] = reference;
        s->has_past = 1;
    } else if (s->has_past) {
        s->past[0] = before;
        s->past[1] = 2 * before - first;
    }
    if (drive < LIMITS_LOW || drive > LIMITS_HIGH) {
        inverse_remember(s, clip(drive));
    }
    return drive;
}
"""
