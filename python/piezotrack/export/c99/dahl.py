"""The Dahl operator in C, in the observer of the hysteresis and in the online inverse."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .text import Constant, Field, Operations, Part

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["dahl_observer", "dahl_operator"]

# Terms of the power series of an operator of the observer.
TERMS = 6
# Pieces of the way in a sample at most.
MOST_PIECES = 16


def dahl_operator(prefix: str, terms: int, numbers: Sequence[float]) -> tuple[str, list[Constant]]:
    """Make the function that moves a Dahl operator along a monotone piece of its path.

    Parameters
    ----------
    prefix : str
        With which its names begin.
    terms : int
        Of the power series.
    numbers : sequence of float
        a1, a2 and the gain.

    Returns
    -------
    code : str
        The function.
    constants : list of Constant
        Its numbers.
    """
    a1, a2, gain = numbers
    capital = prefix.upper()
    constants = [
        Constant(f"{capital}_A1", a1, "a1, 1/m"),
        Constant(f"{capital}_A2", a2, "a2, 1/m^2"),
        Constant(f"{capital}_GAIN", gain, "curvature of the branch from rest"),
        Constant(
            f"{capital}_RECIPROCAL", [1.0 / max(k, 1) for k in range(terms + 1)], "1/k, k from 1"
        ),
    ]
    code = ALONG.replace("@prefix", prefix).replace("@CAPITAL", capital)
    return code.replace("@terms", str(terms)), constants


ALONG = """\
/* Force and slope of the hysteresis after a monotone way: a power series in the distance. */
static void @prefix_along(real *force, real *slope, real direction, real distance)
{
    const real decay = -(direction * @CAPITAL_A1);
    const real spring = -@CAPITAL_A2;
    real d[@terms]; /* derivatives of the force along the path */
    real f, g;
    int k;
    d[0] = *slope;
    d[1] = spring * *force + (decay * *slope + @CAPITAL_GAIN);
    for (k = 2; k < @terms; k++) {
        d[k] = spring * d[k - 2] + decay * d[k - 1];
    }
    f = d[@terms - 1];
    g = d[@terms - 1];
    for (k = @terms - 1; k >= 1; k--) {
        f = distance * @CAPITAL_RECIPROCAL[k + 1] * f + d[k - 1];
        if (k > 1) {
            g = distance * @CAPITAL_RECIPROCAL[k] * g + d[k - 1];
        }
    }
    *force = distance * f + *force;
    *slope = distance * g + d[0];
}
"""


def along_operations(terms: int) -> Operations:
    """Count the operations of a piece of the way."""
    series = 2 + (terms - 2)
    horner = (terms - 1) + (terms - 2)
    return Operations(series + horner + 2, 3 + 2 * (terms - 2) + 2 * horner + 2)


def dahl_observer(numbers: Mapping[str, Sequence[float]], unit: str) -> Part:
    """Make the observer of a Dahl hysteresis around a PID."""
    pole, fresh, correction, a1, a2, gain, longest = numbers["dahl-observer"]
    along, constants = dahl_operator("hysteresis", TERMS, (a1, a2, gain))
    return Part(
        title="observer of a Dahl hysteresis",
        constants=(
            Constant("OBSERVER_POLE", pole, "p, of the linear part"),
            Constant("OBSERVER_FRESH", fresh, f"g (1 - p), m/{unit}"),
            Constant("OBSERVER_CORRECTION", correction, "L, share that corrects the estimate"),
            Constant("OBSERVER_PIECE", longest, "longest way in one piece, m"),
            *constants,
        ),
        fields=(
            Field("real", "hysteresis_force", f"estimated hysteresis w, {unit}"),
            Field("real", "hysteresis_slope", f"its slope along the path, {unit}/m"),
            Field("real", "observer_displacement", "estimated displacement, m"),
            Field("real", "observer_place", "place of the operator on its path, m"),
            Field("real", "observer_first", f"output to begin with, {unit}"),
            Field("real", "observer_volts", f"the last output, {unit}"),
            Field("flag", "observer_begun", "whether there was a sample"),
            Field("flag", "observer_starts", "whether there is an output to begin with"),
        ),
        code=along + OBSERVER_CODE.replace("@pieces", str(MOST_PIECES)),
        # One piece: the way, and what is left of it.
        operations=along_operations(TERMS) + Operations(11, 5, 1),
    )


OBSERVER_CODE = """\

static void hysteresis_rest(NAME_state *s)
{
    s->hysteresis_force = 0;
    s->hysteresis_slope = 0;
    s->observer_displacement = 0;
    s->observer_place = 0;
    s->observer_begun = 0;
}

static void observer_rest(NAME_state *s)
{
    pid_rest(s);
    hysteresis_rest(s);
    s->observer_first = 0;
    s->observer_volts = 0;
    s->observer_starts = 0;
}

static void observer_start(NAME_state *s, real volts)
{
    observer_rest(s);
    s->observer_first = volts;
    s->observer_volts = volts;
    s->observer_starts = 1;
}

/* Moves the operator to a place on its path. */
static void observer_follow(NAME_state *s, real place)
{
    const real way = place - s->observer_place;
    const real direction = way < 0 ? -1 : 1;
    real left = magnitude(way);
    int i;
    for (i = 0; i < @pieces && left > 0; i++) {
        const real piece = left < OBSERVER_PIECE ? left : OBSERVER_PIECE;
        hysteresis_along(
            &s->hysteresis_force, &s->hysteresis_slope, direction, direction * piece);
        left -= piece;
    }
    s->observer_place = place;
}

/* Corrects displacement and hysteresis by the measurement. */
static void observer_observe(NAME_state *s, const struct sample *in)
{
    real before, kept, ahead;
    if (!s->observer_begun) {
        s->observer_begun = 1;
        s->observer_displacement = in->measured;
        observer_follow(s, in->measured);
        return;
    }
    before = s->hysteresis_force;
    kept = OBSERVER_POLE * s->observer_displacement;
    ahead = kept + OBSERVER_FRESH * (in->applied - before);
    s->observer_displacement = ahead + OBSERVER_CORRECTION * (in->measured - ahead);
    observer_follow(s, s->observer_displacement);
    s->hysteresis_force += OBSERVER_CORRECTION
        * (in->applied - s->hysteresis_force - (in->measured - kept) / OBSERVER_FRESH);
}

static real observer_step(NAME_state *s, const struct sample *in)
{
    real volts;
    observer_observe(s, in);
    if (s->observer_starts) {
        s->observer_starts = 0;
        pid_start(s, s->observer_first - s->hysteresis_force);
    }
    volts = pid_step(s, in) + s->hysteresis_force;
    if (is_finite(volts)) {
        s->observer_volts = volts;
    } else {
        hysteresis_rest(s); /* overflow: hold the output, and observe again */
    }
    return s->observer_volts;
}
"""
