"""The controller in C that composes its parts, line by line that of rust/control."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from .c_text import Constant, Field, Operations, Part

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Shape", "filters", "helpers", "loop", "readings", "sample"]

# As in rust/control: share of the range within which a reported voltage counts as the command.
READING = 0.01
# Numbers from here on enter no state: 1e100 in rust/control, which is no float.
USABLE = {False: 1e100, True: 1e30}


UNLEARNT = Field("real", "unlearnt", "error that is yet to be learnt, m")


class Shape(NamedTuple):
    """What the composing functions have to know of the parts.

    Attributes
    ----------
    law : str
        With which the functions of the feedback law begin; empty without one.
    sample : tuple of str
        What the law is told besides error and excess.
    repeats, pauses : bool
        Whether there is a repetitive part, and whether it pauses under saturation.
    filtered : bool
        Whether there are filters.
    forward : {"given", "table", "online"}
        Where the feedforward comes from: the caller, a table, the inverse of a Dahl stage.
    """

    law: str
    sample: tuple[str, ...]
    repeats: bool
    pauses: bool
    filtered: bool
    forward: str


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


def loop(limits: tuple[float, float], unit: str, shape: Shape) -> Part:
    """Make the functions that the caller calls."""
    low, high = limits
    width = high - low
    constants = [
        Constant("FAR_LOW", low - width, f"limits less their range: no feedforward below, {unit}"),
        Constant("FAR_HIGH", high + width, f"limits and their range: none above, {unit}"),
    ]
    if shape.pauses or shape.forward == "online":
        constants.append(
            Constant("APPLIED_NEAR", READING * width, f"a reported one as the command, {unit}")
        )
    fields = (
        Field("real", "present", f"command to go on from, {unit}"),
        Field("real", "excess", f"voltage applied less the unclipped command, {unit}"),
        *([UNLEARNT] if shape.repeats else []),
        Field("flag", "has_present", "whether there is a command to go on from"),
        Field("flag", "stepped", "whether there was a step"),
        Field("flag", "reported", "whether the excess is of a reported voltage"),
        Field("flag", "apart", "whether the next sample is the first after a start or a report"),
    )
    return Part(
        title="the controller",
        constants=tuple(constants),
        fields=fields,
        code=_loop_code(shape),
        operations=_loop_operations(shape),
    )


def _loop_operations(shape: Shape) -> Operations:
    """Count error, sum of the parts and excess, and what the law is told besides."""
    told = int("applied" in shape.sample) + int("feedforward" in shape.sample and shape.repeats)
    return Operations(3 + int(shape.repeats) + told)


def _loop_code(shape: Shape) -> str:
    law, repeats = shape.law, shape.repeats
    pieces = {
        "@arguments": {
            "given": "real reference, real measured, real feedforward",
            "table": "real reference, real measured",
            "online": "real reference, real next, real measured",
        }[shape.forward],
        "@forward": {
            "given": "",
            "table": "    const real feedforward = table_step(s);\n",
            "online": "    const real feedforward = online_step(s, reference, next);\n",
        }[shape.forward],
        "@declare": _declarations(shape),
        "@first": FIRST if law else FIRST_NO_LAW,
        "@accurate": ACCURATE if shape.pauses else "",
        "@repeats": REPEATS[shape.pauses] if repeats else "",
        "@begin": BEGIN.replace("@other", " - repetitive" if repeats else "").replace("@law", law)
        if law
        else "",
        "@forget": "    s->unlearnt = 0;\n" if repeats else "",
        "@error": _error_code(shape),
        "@law": _law_code(shape),
        "@keep": "        s->unlearnt = error;\n" if repeats else "",
        "@sum": "feedback + used + repetitive" if repeats else "feedback + used",
        "@repetitive": "repetitive" if repeats else "0",
        "@reached": REACHED if shape.forward == "online" else "",
        "@rest": _rest_code(shape),
        "@init": "    s->place = 0;\n" if shape.forward == "table" else "",
    }
    code = VOLTAGE_CODE + STEP_CODE
    code += (REMEMBER_REACHED if shape.forward == "online" else "") + START_CODE
    for key, piece in pieces.items():
        code = code.replace(key, piece)
    return code


def sample(shape: Shape) -> Part:
    """Make what the law is told of a sample; it comes before the law."""
    lines = {
        "measured": "    real measured;    /* filtered measurement, m */\n",
        "applied": "    real applied;     /* voltage at the actuator since the sample before */\n",
        "feedforward": "    real feedforward; /* the other parts of this command */\n",
    }
    told = "".join(lines[one] for one in shape.sample)
    return Part(title="the feedback law", code=SAMPLE_STRUCT.replace("@told", told))


def _declarations(shape: Shape) -> str:
    lines = {
        "    const real applied = voltage(s);\n": "applied" in shape.sample,
        "    int begins = 0;\n": bool(shape.law),
        "    real learns = s->excess;\n": shape.pauses,
        "    real repetitive;\n": shape.repeats,
    }
    return "".join(line for line, used in lines.items() if used)


def _error_code(shape: Shape) -> str:
    measured = "filters_step(s, measured)" if shape.filtered else "measured"
    lines = "        struct sample in;\n" if shape.law else ""
    if "measured" in shape.sample:
        lines += f"        in.measured = {measured};\n"
        measured = "in.measured"
    return f"{lines}        error = reference - {measured};\n"


def _law_code(shape: Shape) -> str:
    """Write the call of the law within a step."""
    if not shape.law:
        return ""
    told = {
        "measured": "",
        "applied": "        in.applied = applied;\n",
        "feedforward": "        in.feedforward = used"
        + (" + repetitive" if shape.repeats else "")
        + ";\n",
    }
    lines = "".join(told[one] for one in shape.sample)
    return LAW.replace("@told", lines).replace("@law", shape.law)


def _rest_code(shape: Shape) -> str:
    lines = ["    readings_rest(s);\n"]
    if shape.law:
        lines.append(f"    {shape.law}_rest(s);\n")
    if shape.repeats:
        lines.append("    repetitive_rest(s);\n    s->unlearnt = 0;\n")
    if shape.filtered:
        lines.append("    s->filter_begun = 0;\n")
    if shape.forward == "online":
        lines.append("    inverse_rest(s);\n")
    return "".join(lines)


SAMPLE_STRUCT = """\
/* What the feedback law is told of a sample. */
struct sample {
    real error;       /* reference less filtered measurement, m */
    real excess;      /* voltage applied in the sample before less its unclipped command */
@told};
"""

VOLTAGE_CODE = """\
/* The voltage at the actuator: the last command, or what was reported. */
static real voltage(const NAME_state *s)
{
    return s->stepped ? s->last.unclipped + s->excess : s->last.volts;
}

"""

ACCURATE = """\
        if (s->reported && magnitude(s->excess) <= APPLIED_NEAR) {
            learns = 0;
        }
"""
FIRST = """\
    if (s->apart) {
        /* the first sample after a start or a report */
@accurate        s->stepped = 1;
        s->reported = 0;
        s->apart = 0;
        begins = s->has_present;
        s->has_present = 0;
    }
"""
FIRST_NO_LAW = """\
    if (s->apart) {
        /* the first sample after a start or a report */
@accurate        s->stepped = 1;
        s->reported = 0;
        s->apart = 0;
        s->has_present = 0; /* without feedback nothing can hold it */
    }
"""
REPEATS = {
    True: "    repetitive = repetitive_step(s, s->unlearnt, learns);\n",
    False: "    repetitive = repetitive_step(s, s->unlearnt);\n",
}
BEGIN = """\
    if (begins) {
        feedback = s->present - used@other;
        @law_start(s, feedback);
        s->excess = 0;
    }
"""
LAW = """\
        in.error = error;
        in.excess = s->excess;
@told        volts = @law_step(s, &in);
        feedback = is_finite(volts) ? volts : feedback;
"""

STEP_CODE = """\
NAME_real NAME_step(NAME_state *s, @arguments)
{
@forward    const int measurement_ok = readings_accept(s, measured);
    const int reference_fits = reference >= REFERENCE_LOW && reference <= REFERENCE_HIGH;
@declare    real used = feedforward;
    real feedback = s->last.feedback;
    real error = s->last.error;
    real unclipped, volts;
    int feedforward_ok = 1;
    if (!is_usable(used)) {
        feedforward_ok = 0;
        used = s->last.feedforward;
    } else if (used < FAR_LOW) {
        used = FAR_LOW;
    } else if (used > FAR_HIGH) {
        used = FAR_HIGH;
    }
@first@repeats@begin@forget    if (measurement_ok && reference_fits) {
@error@law@keep    }
    unclipped = @sum;
    if (!is_finite(unclipped)) {
        unclipped = s->last.volts; /* the sum overflowed */
    }
    volts = clip(unclipped);
    s->excess = volts - unclipped;
    s->last.volts = volts;
    s->last.unclipped = unclipped;
    s->last.feedforward = used;
    s->last.feedback = feedback;
    s->last.repetitive = @repetitive;
    s->last.error = error;
    s->last.saturated = s->excess < 0 || s->excess > 0;
    s->last.measurement_ok = (uint8_t)measurement_ok;
    s->last.reference_ok = (uint8_t)(reference_fits && feedforward_ok);
    return volts;
}

"""

REACHED = """\
    remember_reached(s);
"""

REMEMBER_REACHED = """\
/* How much of the feedforward reached the stage: that is what the inverse remembers. */
static void remember_reached(NAME_state *s)
{
    const real asked = s->last.feedforward;
    const real there = voltage(s);
    real reached = clip(asked);
    if (s->excess < -APPLIED_NEAR) {
        reached = reached < there ? reached : there;
    } else if (s->excess > APPLIED_NEAR) {
        reached = reached > there ? reached : there;
    }
    if (reached < asked || reached > asked) {
        inverse_remember(s, reached);
    }
}

"""

START_CODE = """\
int NAME_applied(NAME_state *s, real volts)
{
    if (!is_finite(volts)) {
        return 0;
    }
    if (s->stepped && volts >= FAR_LOW && volts <= FAR_HIGH) {
        s->excess = volts - s->last.unclipped;
        s->reported = 1;
        s->apart = 1;
    }
@reached    return 1;
}

static void rest(NAME_state *s, real volts)
{
    s->last.volts = volts;
    s->last.unclipped = 0;
    s->last.feedforward = 0;
    s->last.feedback = 0;
    s->last.repetitive = 0;
    s->last.error = 0;
    s->last.saturated = 0;
    s->last.measurement_ok = 0;
    s->last.reference_ok = 0;
    s->excess = 0;
    s->stepped = 0;
    s->reported = 0;
    s->apart = 1;
@rest}

void NAME_init(NAME_state *s)
{
    rest(s, clip(0));
    s->present = 0;
    s->has_present = 0;
@init}

int NAME_start(NAME_state *s, real present)
{
    if (!(present >= LIMITS_LOW && present <= LIMITS_HIGH)) {
        return 0;
    }
    NAME_init(s);
    s->last.volts = present;
    s->present = present;
    s->has_present = 1;
    return 1;
}

void NAME_reset(NAME_state *s)
{
    const real present = clip(voltage(s));
    if (s->stepped) {
        s->present = present;
        s->has_present = 1;
    }
    rest(s, present);
}
"""
