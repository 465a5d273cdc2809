"""The repetitive part in C, line by line that of rust/control/src/repetitive."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .text import Constant, Field, Operations, Part

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["repetitive"]


def repetitive(numbers: Mapping[str, Sequence[float]], unit: str) -> Part:
    """Make the repetitive part; its delay line is an array in the state."""
    pole, gain, period, pause = numbers["repetitive"]
    lead, _, entries, unread, whole = (int(one) for one in numbers["repetitive lengths"])
    taps = numbers["taps"]
    constants = [
        Constant("REPETITIVE_POLE", pole, "p, of the filter Q"),
        Constant("REPETITIVE_GAIN", gain, f"Kq, {unit}/m"),
        Constant("REPETITIVE_TAPS", taps, "weights of the samples of a period ago, oldest first"),
    ]
    fields = [
        Field("real", "learnt", f"delay line: uRC + Kq e, {unit}", entries),
        Field("real", "repetitive_volts", f"the last output uRC, {unit}"),
        Field("count", "line_next", "entry of the line that is written next"),
    ]
    if pause:
        ahead = period - whole
        constants.append(Constant("REPETITIVE_AHEAD", ahead, "period less its whole samples"))
        fields += [
            Field("real", "given", f"delay line: uRC, {unit}", entries),
            Field("real", "behind", "samples by which held periods were too short"),
            Field("count", "left", "samples left of a held period, or of resuming"),
            Field("count", "since", "samples since the first clipped one that counts"),
            Field("count", "clipped", "clipped samples that count"),
            Field("count", "inward", "clipped samples whose error points inward"),
            Field("count", "well", "held periods with few clipped samples"),
            Field("flag", "learning", "0 learns, 1 holds what was learnt, 2 resumes"),
        ]
    line = LINE_CODE.replace("@store", STORE if pause else STORE_ALWAYS)
    code = line.replace("@learn", LEARN_EARLIER if lead else LEARN)
    code += (PAUSE_CODE + STEP_CODE) if pause else STEP_ALWAYS
    sizes = {
        "@entries": entries,
        "@unread": unread,
        "@lead": lead,
        "@taps": len(taps),
        "@whole": whole,
        "@quarter": whole // 4,
    }
    for key, size in sizes.items():
        code = code.replace(key, f"{size}u")
    count = len(taps)
    return Part(
        title="repetitive part",
        constants=tuple(constants),
        fields=tuple(fields),
        code=code,
        operations=Operations(count + 3, count + 2),
    )


LINE_CODE = """\
/* A sum of products, as two sums that the processor can compute side by side. */
static real weighted(const real *entries, const real *taps, uint32_t count)
{
    real even = 0;
    real odd = 0;
    uint32_t i;
    for (i = 0; i + 1 < count; i += 2) {
        even += entries[i] * taps[i];
        odd += entries[i + 1] * taps[i + 1];
    }
    if (i < count) {
        even += entries[i] * taps[i];
    }
    return even + odd;
}

/* The filter Q of what was learnt a period ago, without its memory. */
static real line_filtered(const NAME_state *s)
{
    uint32_t first = s->line_next + @unread;
    uint32_t older = @taps;
    real sum;
    if (first >= @entries) {
        first -= @entries;
    }
    if (older > @entries - first) {
        older = @entries - first;
    }
    sum = weighted(&s->learnt[first], REPETITIVE_TAPS, older);
    if (older < @taps) {
        sum = sum + weighted(s->learnt, &REPETITIVE_TAPS[older], @taps - older);
    }
    return sum;
}

@store
/* A voltage within the range of the limits; 0 where it is not a number. */
static real line_bounded(real volts)
{
    return volts < 0 || volts >= 0 ? within(volts, LIMITS_RANGE) : 0;
}
"""

# What is learnt, and with it what was put out where that may have to be repeated.
STORE = """\
static void line_store(NAME_state *s, real sum, real volts, real learns)
{
    s->given[s->line_next] = volts;
    s->learnt[s->line_next] = sum;
@learn
    s->line_next = s->line_next + 1u < @entries ? s->line_next + 1u : 0u;
}
"""
STORE_ALWAYS = STORE.replace("real volts, ", "").replace(
    "    s->given[s->line_next] = volts;\n", ""
)
LEARN = "    s->learnt[s->line_next] += learns;"
LEARN_EARLIER = """\
    /* the error belongs to an earlier sample, as the stage answers later */
    s->learnt[s->line_next >= @lead ? s->line_next - @lead : s->line_next + @entries - @lead]
        += learns;"""

PAUSE_CODE = """\

enum { LEARNS, HOLDS, RESUMES };

/* Holds for another period, of as many samples as keeps it in phase with the reference. */
static void line_hold_another(NAME_state *s)
{
    s->behind += REPETITIVE_AHEAD;
    s->left = @whole;
    if (s->behind > (real)0.5 && s->left < @entries) {
        s->behind -= 1;
        s->left += 1u;
    } else if (s->behind < -(real)0.5 && s->left > 1u) {
        s->behind += 1;
        s->left -= 1u;
    }
    s->learning = HOLDS;
}

/* The end of a held period: another one where too much was clipped, and once more after that. */
static void line_end_held(NAME_state *s)
{
    s->inward = 0;
    s->well = s->clipped > @quarter ? 0 : one_more(s->well);
    s->clipped = 0;
    if (s->well < 2u) {
        line_hold_another(s);
    } else {
        s->well = 0;
        s->learning = RESUMES;
        s->left = @entries;
    }
}

/* Whether to learn in this sample; `clipped` is of the sample before. */
static void line_follow(NAME_state *s, int clipped)
{
    if (s->learning == HOLDS) {
        s->left = s->left > 0u ? s->left - 1u : 0u;
        s->clipped = clipped ? one_more(s->clipped) : s->clipped;
        if (s->left == 0u) {
            line_end_held(s);
        }
        return;
    }
    if (s->learning == RESUMES && s->left > 1u) {
        s->left -= 1u;
    } else {
        s->learning = LEARNS;
    }
    s->since = one_more(s->since);
    if (clipped && s->since >= @whole) {
        s->since = 0;
        s->clipped = 0;
    }
    s->clipped = clipped ? one_more(s->clipped) : s->clipped;
    if (clipped && s->clipped > @quarter) {
        s->since = UINT32_MAX;
        s->clipped = 0;
        s->inward = 0;
        s->behind = 0;
        line_hold_another(s);
    }
}

/* Whether a held period was clipped by what is held, and not by the reference. */
static int line_is_latched(NAME_state *s, real error, real excess, int clipped)
{
    if (s->learning != HOLDS) {
        return 0;
    }
    if (clipped && excess * error > 0) {
        s->inward += 1u;
    }
    return s->left <= 1u && s->inward > @quarter && s->inward > s->clipped / 2u;
}

static void line_forget_half(NAME_state *s)
{
    uint32_t i;
    for (i = 0; i < @entries; i++) {
        s->learnt[i] *= (real)0.5;
        s->given[i] *= (real)0.5;
    }
}

/* What was put out `age` samples ago. */
static real line_repeated(const NAME_state *s, uint32_t age)
{
    const uint32_t next = s->line_next;
    return s->given[next >= age ? next - age : next + @entries - age];
}

/* A sample while command or memory are affected by saturation. */
static real line_saturated(NAME_state *s, real error, real excess, int clipped)
{
    const int was_held = s->learning == HOLDS;
    const real volts = s->repetitive_volts;
    real out;
    if (line_is_latched(s, error, excess, clipped)) {
        line_forget_half(s);
    }
    line_follow(s, clipped);
    if (!was_held && clipped) {
        /* as much of uRC as takes the command to the limit */
        const real used = volts + excess;
        const real low = volts < 0 ? volts : 0;
        const real high = volts > 0 ? volts : 0;
        line_store(s, used < low ? low : used > high ? high : used, volts, 0);
    } else if (!was_held) {
        line_store(s, volts, volts, REPETITIVE_GAIN * error);
    }
    if (s->learning == LEARNS) {
        out = REPETITIVE_POLE * volts + line_filtered(s);
    } else {
        out = line_repeated(s, s->learning == HOLDS ? s->left : @whole);
    }
    s->repetitive_volts = line_bounded(out);
    return s->repetitive_volts;
}
"""

STEP_CODE = """\

static void repetitive_rest(NAME_state *s)
{
    uint32_t i;
    for (i = 0; i < @entries; i++) {
        s->learnt[i] = 0;
        s->given[i] = 0;
    }
    s->repetitive_volts = 0;
    s->line_next = 0;
    s->behind = 0;
    s->left = 0;
    s->since = UINT32_MAX;
    s->clipped = 0;
    s->inward = 0;
    s->well = 0;
    s->learning = LEARNS;
}

/* uRC of this sample, from error and excess of the sample before. */
static real repetitive_step(NAME_state *s, real error, real excess)
{
    const int clipped = excess < 0 || excess > 0;
    const real volts = s->repetitive_volts;
    if (clipped || s->learning != LEARNS) {
        return line_saturated(s, error, excess, clipped);
    }
    s->since = one_more(s->since);
    line_store(s, volts, volts, REPETITIVE_GAIN * error);
    s->repetitive_volts = line_bounded(REPETITIVE_POLE * volts + line_filtered(s));
    return s->repetitive_volts;
}
"""

STEP_ALWAYS = """\

static void repetitive_rest(NAME_state *s)
{
    uint32_t i;
    for (i = 0; i < @entries; i++) {
        s->learnt[i] = 0;
    }
    s->repetitive_volts = 0;
    s->line_next = 0;
}

/* uRC of this sample, from the error of the sample before; it learns under saturation too. */
static real repetitive_step(NAME_state *s, real error)
{
    const real volts = s->repetitive_volts;
    line_store(s, volts, REPETITIVE_GAIN * error);
    s->repetitive_volts = line_bounded(REPETITIVE_POLE * volts + line_filtered(s));
    return s->repetitive_volts;
}
"""
