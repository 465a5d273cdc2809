"""Feedback laws in C, line by line those of rust/control."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .text import Constant, Field, Operations, Part

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    Numbers = Mapping[str, Sequence[float]]

__all__ = ["damping", "disturbance_observer", "no_law", "pid", "sliding_mode", "state_space"]


def no_law() -> Part:
    """Make no feedback: tracking by feedforward alone."""
    return Part(title="no feedback", code="")


def pid(numbers: Numbers, unit: str) -> Part:
    """Make the incremental PID with back-calculation."""
    proportional, integral, derivative, tracking = numbers["pid"]
    first = "" if integral else PD_FIRST
    return Part(
        title="incremental PID with back-calculation antiwindup",
        constants=(
            Constant("PID_PROPORTIONAL", proportional, f"Kp, {unit}/m"),
            Constant("PID_INTEGRAL", integral, f"Kp Ts/Ti, {unit}/m"),
            Constant("PID_DERIVATIVE", derivative, f"Kp Td/Ts, {unit}/m"),
            Constant("PID_TRACKING", tracking, "Ts/Tt, of the antiwindup"),
        ),
        fields=(
            Field("real", "pid_volts", f"output, {unit}"),
            Field("real", "pid_e1", "the last error, m"),
            Field("real", "pid_e2", "the error before it, m"),
            Field("flag", "pid_begun", "whether there was an error"),
        ),
        code=PID_CODE.replace("@first", first),
        operations=Operations(7, 4),
    )


PD_FIRST = """
    if (!s->pid_begun && !(s->pid_volts < 0 || s->pid_volts > 0)) {
        /* nothing would ever make up for what the first error asks for */
        s->pid_volts = PID_PROPORTIONAL * error;
    }"""

PID_CODE = """\
static void pid_start(NAME_state *s, real volts)
{
    s->pid_volts = volts;
    s->pid_e1 = 0;
    s->pid_e2 = 0;
    s->pid_begun = 0;
}

static void pid_rest(NAME_state *s)
{
    pid_start(s, 0);
}

static real pid_step(NAME_state *s, const struct sample *in)
{
    const real error = in->error;
    /* the first error stands for the earlier ones too: no derivative kick */
    const real e1 = s->pid_begun ? s->pid_e1 : error;
    const real e2 = s->pid_begun ? s->pid_e2 : error;
    const real rise = error - e1;
    const real bend = rise - (e1 - e2);
    const real change = PID_PROPORTIONAL * rise + PID_INTEGRAL * error + PID_DERIVATIVE * bend
        + PID_TRACKING * in->excess;
    real volts;
@first
    volts = s->pid_volts + change;
    if (is_finite(volts)) {
        s->pid_volts = volts;
        s->pid_e1 = error;
        s->pid_e2 = e1;
        s->pid_begun = 1;
    } else {
        /* overflow: hold the output, start again from the next error */
        s->pid_begun = 0;
    }
    return s->pid_volts;
}
"""


def state_space(numbers: Numbers, unit: str) -> Part:
    """Make the law in state space."""
    n = len(numbers["b"])
    back = "back" in numbers
    constants = [
        Constant("LAW_A", numbers["a"], "A, row by row"),
        Constant("LAW_B", numbers["b"], "B"),
        Constant("LAW_C", numbers["c"], "C"),
        Constant("LAW_D", numbers["d"][0], f"D, {unit}/m"),
    ]
    if back:
        constants.append(Constant("LAW_BACK", numbers["back"], "l, of the antiwindup"))
    code = STATE_SPACE_CODE.replace("@advance", WITH_BACK if back else WITHOUT_BACK)
    return Part(
        title=f"law in state space, {n} state{'s' if n > 1 else ''}",
        constants=tuple(constants),
        fields=(
            Field("real", "law_x", "the states", n),
            Field("real", "law_error", "the last error, m"),
            Field("real", "law_first", f"output to begin with, {unit}"),
            Field("real", "law_offset", f"constant part of the output, {unit}"),
            Field("flag", "law_begun", "whether there was an error"),
            Field("flag", "law_starts", "whether there is an output to begin with"),
        ),
        code=code.replace("@n", str(n)),
        operations=_state_space_operations(n, back=back),
    )


def _state_space_operations(n: int, *, back: bool) -> Operations:
    dot = Operations(n, n)
    rows = Operations(n * (n + 1), n * (n + 1))
    output = dot + Operations(2, 1)
    if back:
        return rows + Operations(n, n) + output
    return rows + dot + dot + Operations(1, 1) + output


WITH_BACK = """\
    for (i = 0; i < @n; i++) {
        next[i] += LAW_BACK[i] * excess;
    }"""
WITHOUT_BACK = """\
    if (excess * (law_dot(LAW_C, next) - law_dot(LAW_C, s->law_x)) < 0) {
        return; /* it would move the command further beyond the limit */
    }"""

STATE_SPACE_CODE = """\
static real law_dot(const real *a, const real *b)
{
    real sum = 0;
    int i;
    for (i = 0; i < @n; i++) {
        sum = sum + a[i] * b[i];
    }
    return sum;
}

static void law_rest(NAME_state *s)
{
    int i;
    for (i = 0; i < @n; i++) {
        s->law_x[i] = 0;
    }
    s->law_error = 0;
    s->law_first = 0;
    s->law_offset = 0;
    s->law_begun = 0;
    s->law_starts = 0;
}

static void law_start(NAME_state *s, real volts)
{
    law_rest(s);
    s->law_first = volts;
    s->law_starts = 1;
}

/* Advances the states by the last sample, whose error and excess are known now. */
static void law_advance(NAME_state *s, real error, real excess)
{
    real next[@n];
    int i;
    for (i = 0; i < @n; i++) {
        next[i] = law_dot(&LAW_A[@n * i], s->law_x) + LAW_B[i] * error;
    }
@advance
    for (i = 0; i < @n; i++) {
        s->law_x[i] = next[i];
    }
}

static real law_step(NAME_state *s, const struct sample *in)
{
    real volts;
    if (s->law_begun) {
        law_advance(s, s->law_error, in->excess);
    } else if (s->law_starts) {
        s->law_offset = s->law_first - LAW_D * in->error;
    }
    s->law_error = in->error;
    s->law_begun = 1;
    volts = law_dot(LAW_C, s->law_x) + LAW_D * in->error + s->law_offset;
    if (is_finite(volts)) {
        return volts;
    }
    law_rest(s); /* overflow: start again */
    return 0;
}
"""


def sliding_mode(numbers: Numbers, unit: str) -> Part:
    """Make sliding mode control with a boundary layer."""
    switching, gain, integral, derivative, fresh = numbers["sliding-mode"]
    begin = SLIDING_INTEGRAL if integral > 0.0 else SLIDING_NO_INTEGRAL
    return Part(
        title="sliding mode control with a boundary layer",
        constants=(
            Constant("SLIDING_SWITCHING", switching, f"eta, the largest output, {unit}"),
            Constant("SLIDING_GAIN", gain, f"eta/phi, inside of the layer, {unit}/m"),
            Constant("SLIDING_INTEGRAL", integral, "Ts/Ti"),
            Constant("SLIDING_DERIVATIVE", derivative, "Td/Ts"),
            Constant("SLIDING_FRESH", fresh, "share of a new difference in the filtered one"),
        ),
        fields=(
            Field("real", "sliding_integral", "integral part of the surface, m"),
            Field("real", "sliding_change", "filtered change of the error in a sample, m"),
            Field("real", "sliding_error", "the last error, m"),
            Field("real", "sliding_base", f"output to begin with, {unit}"),
            Field("real", "sliding_volts", f"the last output, {unit}"),
            Field("flag", "sliding_begun", "whether there was an error"),
            Field("flag", "sliding_starts", "whether there is an output to begin with"),
        ),
        code=SLIDING_CODE.replace("@begin", begin),
        operations=Operations(8, 6),
    )


SLIDING_INTEGRAL = """\
    const real inside = within(s->sliding_base, SLIDING_SWITCHING);
    s->sliding_integral = inside / SLIDING_GAIN - error * (1 + SLIDING_INTEGRAL);
    s->sliding_base -= inside;"""
SLIDING_NO_INTEGRAL = """\
    s->sliding_base -= within(SLIDING_GAIN * error, SLIDING_SWITCHING);"""

SLIDING_CODE = """\
static void sliding_start(NAME_state *s, real volts)
{
    s->sliding_integral = 0;
    s->sliding_change = 0;
    s->sliding_error = 0;
    s->sliding_base = volts;
    s->sliding_volts = volts;
    s->sliding_begun = 0;
    s->sliding_starts = 1;
}

static void sliding_rest(NAME_state *s)
{
    sliding_start(s, 0);
    s->sliding_starts = 0;
}

/* The first output is the one to begin with: as much of it as can be is integral. */
static void sliding_begin(NAME_state *s, real error)
{
@begin
}

static real sliding_step(NAME_state *s, const struct sample *in)
{
    const real error = in->error;
    const real old = s->sliding_begun ? s->sliding_error : error;
    real change, step, integral, surface, asked, volts;
    if (!s->sliding_begun && s->sliding_starts) {
        sliding_begin(s, error);
    }
    s->sliding_starts = 0;
    change = s->sliding_change + SLIDING_FRESH * (error - old - s->sliding_change);
    step = SLIDING_INTEGRAL * error;
    integral = s->sliding_integral + step;
    surface = error + SLIDING_DERIVATIVE * change + integral;
    if (!is_finite(surface)) {
        s->sliding_begun = 0;
        s->sliding_change = 0;
        return s->sliding_volts;
    }
    asked = SLIDING_GAIN * surface;
    volts = within(asked, SLIDING_SWITCHING);
    /* beyond the layer or the limits, the integral does not go further out */
    if (!((volts - asked) * step < 0 || in->excess * step < 0)) {
        s->sliding_integral = integral;
    }
    s->sliding_change = change;
    s->sliding_error = error;
    s->sliding_begun = 1;
    s->sliding_volts = volts + s->sliding_base;
    return s->sliding_volts;
}
"""


def disturbance_observer(numbers: Numbers, unit: str, inner: str) -> Part:
    """Make the disturbance observer around the law whose functions begin with `inner`."""
    fresh, pole, inverse = numbers["disturbance-observer"]
    return Part(
        title="disturbance observer",
        constants=(
            Constant("OBSERVER_FRESH", fresh, "1 - q, of the filter of the estimate"),
            Constant("OBSERVER_POLE", pole, "p, of the nominal plant"),
            Constant("OBSERVER_INVERSE", inverse, f"1/(g (1 - p)), {unit}/m"),
        ),
        fields=(
            Field("real", "observer_disturbance", f"d, {unit}"),
            Field("real", "observer_error", "error of the last sample, m"),
            Field("real", "observer_feedforward", f"feedforward of the last sample, {unit}"),
            Field("real", "observer_first", f"output to begin with, {unit}"),
            Field("real", "observer_volts", f"the last output, {unit}"),
            Field("flag", "observer_begun", "whether there was a sample"),
            Field("flag", "observer_starts", "whether there is an output to begin with"),
        ),
        code=OBSERVER_CODE.replace("@inner", inner),
        operations=Operations(6, 4),
    )


OBSERVER_CODE = """\
static void observer_rest(NAME_state *s)
{
    @inner_rest(s);
    s->observer_disturbance = 0;
    s->observer_error = 0;
    s->observer_feedforward = 0;
    s->observer_first = 0;
    s->observer_volts = 0;
    s->observer_begun = 0;
    s->observer_starts = 0;
}

static void observer_start(NAME_state *s, real volts)
{
    observer_rest(s);
    s->observer_first = volts;
    s->observer_volts = volts;
    s->observer_starts = 1;
}

/* The disturbance that explains the last sample; while the command is clipped it gets no larger in
   the direction that moves the command further beyond the limit. */
static void observer_observe(NAME_state *s, const struct sample *in)
{
    const real needed = -OBSERVER_INVERSE * (in->error - OBSERVER_POLE * s->observer_error);
    const real found = needed - (in->applied - s->observer_feedforward);
    const real step = OBSERVER_FRESH * (found - s->observer_disturbance);
    const real next = s->observer_disturbance + step;
    if (!(in->excess * step > 0 && magnitude(next) > magnitude(s->observer_disturbance))) {
        s->observer_disturbance = next;
    }
}

static real observer_step(NAME_state *s, const struct sample *in)
{
    real inside, volts;
    if (s->observer_begun) {
        observer_observe(s, in);
    }
    inside = @inner_step(s, in);
    if (s->observer_starts) {
        /* a bumpless start is a disturbance that is forgotten as it is observed */
        s->observer_starts = 0;
        s->observer_disturbance = inside - s->observer_first;
    }
    volts = inside - s->observer_disturbance;
    if (is_finite(volts)) {
        s->observer_error = in->error;
        s->observer_feedforward = in->feedforward;
        s->observer_begun = 1;
        s->observer_volts = volts;
    } else {
        /* overflow: hold the output, observe again from the next sample on */
        s->observer_disturbance = 0;
        s->observer_begun = 0;
    }
    return s->observer_volts;
}
"""


def damping(numbers: Numbers, unit: str) -> Part:
    """Make the damping filter of the measurement beside the PID."""
    b0, b1, b2, a1, a2 = numbers["damping"]
    return Part(
        title="damping by a filter of the measurement",
        constants=(
            Constant("DAMPING_B0", b0, f"K = (b0 + b1/z + b2/z^2)/(1 + a1/z + a2/z^2), {unit}/m"),
            Constant("DAMPING_B1", b1, f"{unit}/m"),
            Constant("DAMPING_B2", b2, f"{unit}/m"),
            Constant("DAMPING_A1", a1, "of the poles"),
            Constant("DAMPING_A2", a2, "of the poles"),
        ),
        fields=(
            Field("real", "damping_s1", f"memory of the filter, {unit}"),
            Field("real", "damping_s2", f"memory of the filter, {unit}"),
            Field("real", "damping_origin", "the first reading, m"),
            Field("real", "damping_volts", f"the last output, {unit}"),
            Field("flag", "damping_begun", "whether there was a reading"),
        ),
        code=DAMPING_CODE,
        operations=Operations(6, 5),
    )


DAMPING_CODE = """\
static void damping_forget(NAME_state *s)
{
    s->damping_s1 = 0;
    s->damping_s2 = 0;
    s->damping_origin = 0;
    s->damping_begun = 0;
}

static void damping_start(NAME_state *s, real volts)
{
    pid_start(s, volts);
    damping_forget(s);
    s->damping_volts = volts;
}

static void damping_rest(NAME_state *s)
{
    pid_rest(s);
    damping_forget(s);
    s->damping_volts = 0;
}

static real damping_step(NAME_state *s, const struct sample *in)
{
    real place, damping, volts;
    if (!s->damping_begun) {
        s->damping_origin = in->measured;
        s->damping_begun = 1;
    }
    place = in->measured - s->damping_origin;
    damping = DAMPING_B0 * place + s->damping_s1;
    s->damping_s1 = DAMPING_B1 * place - DAMPING_A1 * damping + s->damping_s2;
    s->damping_s2 = DAMPING_B2 * place - DAMPING_A2 * damping;
    volts = pid_step(s, in) + damping;
    if (is_finite(volts)) {
        s->damping_volts = volts;
    } else {
        /* overflow: hold the output, count from the next reading */
        damping_forget(s);
    }
    return s->damping_volts;
}
"""
