"""Advice of the library in Python, in the options of the command that is at work."""

from __future__ import annotations

import re
from contextvars import ContextVar

import click

__all__ = ["as_options", "command_at_work"]

# Arguments whose option has another name.
OPTIONS = {
    "creep_times": "creep",
    "delay": "sensor_delay",
    "models": "model",
    "rates": "frequencies",
    "seconds": "duration",
    "searches": "runs",
    "count": "plays",
    "dead_zones": "asymmetry",
    "factor": "decimate",
    "goal.largest_error": "largest_error",
    "margins.gain": "gain_margin",
    "margins.phase": "phase_margin",
    "margins.sensitivity": "sensitivity",
    "test": "test_window",
    "train": "window",
    "units": "unit",
}
# Remedies that are no argument, the same for the command line, and the option that this takes.
REMEDIES = [
    (
        r"time=0, drive=1, displacement=2, units=\{.*\}",
        "--time 0 --drive 1 --displacement 2 --unit 0=s --unit 1=V --unit 2=um",
        "--drive",
    ),
    (
        r"time=0, drive=1, displacement=2, units=\{.*\}",
        "--time 0 --displacement 1 --unit 0=s --unit 1=um",
        "--displacement",
    ),
    (r"units=\{'?(\w+)'?: \.\.\.\}", r"--unit \1=...", "--unit"),
    (r"\bin parameters=", "by --fix", "--fix"),
    (r"(?<!\S)units(?=: )", "--unit", "--unit"),
    (r"(?<!\S)(time|drive|displacement)(?=: \S+ is (?:not a|the name of))", r"--\1", "--time"),
    (r"(?<!\S)train(?=: the window )", "--window", "--window"),
    (r"(?<!\S)test(?=: the window )", "--test-window", "--test-window"),
    (r"pt\.\w+\.from_um\(k[pq]=.*\)", "a value in V/um", "--kp"),
    (r"\bmissing='(drop|fill)'", r"--missing \1", "--missing"),
    (r"\bcreep=False", "--creep none", "--creep"),
    # Ingredients of a fit that its residual asks for: these options take a value.
    (r"\btry (?:LeastSquares\(creep=True\)|creep=True)", "try --creep fit", "--creep"),
    (r"\btry LeastSquares\(dynamics=\"second\"\)", "try --dynamics mode", "--dynamics"),
    (r"\btry delay=True", "try --sensor-delay fit", "--sensor-delay"),
    (r"\btry drift=True", "try --drift fit", "--drift"),
    (r"\btry '([a-z-]+)'", r"try --model \1", "--model"),
    (r"\blog\[([^\]]*)\]", r"--window \1", "--window"),
    (r"\bmethod='lifted'", "--from-rest", "--from-rest"),
    (r"\bseeds(?= is\b)", "--draws", "--draws"),
    (r"\breference=(?=,)", "REFERENCE", "--to"),
    # An option of the commands that come after `info`.
    (r"\bfit\.zeroed\(\)", "--zero", "--zero"),
    (r"\boffset=pt\.zero\(stage\)", "--zero", "--zero"),
    (r"\blog\.decimate\((\w+)\)", r"--decimate \1", "--displacement"),
]
# Where a command has no options for columns, the header of the file has to say it.
IN_THE_HEADER = [
    (
        r"name the columns by number and give their units, as in time=0.*",
        "expected one with units, as time_s,displacement_um",
    ),
    (r"(no column is known to be the \w+): name it with [^;]*;", r"\1: expected a usual title;"),
    (r"; choose one with \w+=", ": expected one of them"),
    (r", or give it as units=\{[^}]*\}", ""),
    (r"; an evenly sampled record whose times .*", ""),
]
# An argument in a sentence or a table, as "runs=4", "model='dahl'" or "unstable=True".
ARGUMENT = re.compile(r"(?<![\w'(?{&,])(?<!has )(?<!--unit )(\w+)=(?!\.)(?:True\b|'([\w-]+)'|) ?")

command_at_work: ContextVar[click.Command | None] = ContextVar("_command", default=None)


def as_options(error: object) -> str:
    """Say in options what the library says in arguments."""
    command = command_at_work.get()
    known = {name for one in command.params for name in one.opts} if command else set()

    def in_options(match: re.Match[str]) -> str:
        option = _option(match[1], known)
        return f"{option} {match[2] or ''}" if option in known else match[0]

    text, argument = str(error), getattr(error, "argument", None) or ""
    if (option := _option(argument, known)) in known:
        if option == "--dt" and _has_rate():
            option = "--rate: the interval"
        text = re.sub(rf"(^|: ){re.escape(argument)}(?=[ [])", rf"\1{option}", text, count=1)
    if not known & {"--displacement", "--drive"}:
        for python, words in IN_THE_HEADER:
            text = re.sub(python, words, text)
    if "--resample" not in known:
        text = re.sub(r"; resample= puts it [^;]*", "", text)
    if "--missing" not in known:
        text = re.sub(r"; missing='drop' leaves .*", "", text)
    if "--zero" not in known:
        text = re.sub(r"; fit\.zeroed\(\) .*", "", text)
        text = re.sub(r"offset=pt\.zero\(stage\), .*", "models of one zero", text)
    text = text.replace(", or largest_saturation=0.5 or more", "")
    for python, words, needed in REMEDIES:
        if needed in known:
            text = re.sub(python, words, text)
    text = ARGUMENT.sub(in_options, text)
    # An option at the end of a sentence or before a comma.
    return re.sub(r"(--[a-z-]+) (?=[,;:)\n]|\.(?:\s|$)|$)", r"\1", text)


def _has_rate() -> bool:
    """Whether the interval was given as a rate."""
    context = click.get_current_context(silent=True)
    return context is not None and context.params.get("rate") is not None


def _option(argument: str, known: set[str]) -> str:
    """Return the option of an argument: of its other name, where the command has that."""
    option = f"--{OPTIONS.get(argument, argument)}".replace("_", "-")
    return option if option in known else f"--{argument}".replace("_", "-")
