"""The controller in C that composes its parts, line by line that of rust/control."""

from __future__ import annotations

from typing import NamedTuple

from .text import Constant, Field, Operations, Part

__all__ = ["Shape", "loop", "sample"]

# As in rust/control: share of the range within which a reported voltage counts as the command.
READING = 0.01
# Field of a controller with a repetitive part.
UNLEARNT = Field("real", "unlearnt", "error that is yet to be learnt, m")


class Shape(NamedTuple):
    """Description of the parts for the functions that compose the loop.

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
    lines_of = {
        "measured": "",
        "applied": "        in.applied = applied;\n",
        "feedforward": "        in.feedforward = used"
        + (" + repetitive" if shape.repeats else "")
        + ";\n",
    }
    lines = "".join(lines_of[one] for one in shape.sample)
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
    real there = s->last.volts;
    real reached = clip(asked);
    if (s->reported) {
        /* of a huge command the excess has lost the voltage to rounding */
        there = voltage(s);
        there = there < FAR_LOW ? FAR_LOW : there;
        there = there > FAR_HIGH ? FAR_HIGH : there;
    }
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
