"""Advice of the library in Python, in the options of the command that is at work."""

from __future__ import annotations

import re
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

__all__ = ["as_options", "options_named"]

# What Python says, what the command line says, and the option that this takes.
ADVICE = [
    (
        r"time=0, drive=1, displacement=2, units=\{0: 's', 1: 'V', 2: 'um'\}",
        "--time 0 --drive 1 --displacement 2 --unit 0=s --unit 1=V --unit 2=um",
        "--drive",
    ),
    (
        r"time=0, drive=1, displacement=2, units=\{0: 's', 1: 'V', 2: 'um'\}",
        "--time 0 --displacement 1 --unit 0=s --unit 1=um",
        "--displacement",
    ),
    (r"units=\{'?(\w+)'?: \.\.\.\}", r"--unit \1=...", "--unit"),
    (r"\bunits= says\b", "--unit says", "--unit"),
    (r"\bin parameters=", "by --fix", "--fix"),
    (r"\bbeyond_reach=True", "--beyond-reach", "--beyond-reach"),
    (r"\breference=, ", "--reference, ", "--reference"),
    (r"\bunstable=True", "--unstable", "--unstable"),
    (r"pt\.\w+\.from_um\(k[pq]=.*\)", "a value in V/um", "--kp"),
    (r"\bmissing='(drop|fill)'", r"--missing \1", "--missing"),
    (r"\bcreep=False", "--creep none", "--creep"),
    (r"\bmodel='([\w-]+)'", r"--model \1", "--model"),
    (r"\bcount is (?=\d+: expected 1 to)", "--plays is ", "--plays"),
    (r"\bdead_zones is ", "--asymmetry is ", "--asymmetry"),
    (r"\bmargins\.gain is ", "--gain-margin is ", "--gain-margin"),
    (r"\blargest_error is ", "--allowed-um is ", "--allowed-um"),
    (r"\bmethod '(frequency|lifted)'", r"--method \1", "--mode-scales"),
    (r"\brates (?=begins|ends)", "--rates ", "--rates"),
    (r"\bmode_scales is ", "--mode-scales is ", "--mode-scales"),
    (r"\bmargins\.sensitivity is ", "--sensitivity is ", "--sensitivity"),
    (r"^(speed|port|host|limits|prefix) (?=is|are)", r"--\1 ", "--speed"),
    (r"\blog\[([^\]]*)\]", r"--window \1", "--window"),
    *(
        (rf"(?<!--unit )\b{name}=(?!\.\.\.) ?", f"--{name} ", f"--{name}")
        for name in (
            *("time", "drive", "displacement", "dt", "resample", "period"),
            *("stiffness", "runs", "train", "test"),
        )
    ),
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

_options: ContextVar[frozenset[str]] = ContextVar("_options", default=frozenset())


@contextmanager
def options_named(parameters: Iterable[str]) -> Iterator[None]:
    """Declare which options the command at work has.

    Parameters
    ----------
    parameters : iterable of str
        Its parameters in Python.

    Yields
    ------
    None
    """
    token = _options.set(frozenset(f"--{name.replace('_', '-')}" for name in parameters))
    try:
        yield
    finally:
        _options.reset(token)


def as_options(text: str) -> str:
    """Say in options what the library says in arguments.

    Parameters
    ----------
    text : str
        An error, a remark or a table.

    Returns
    -------
    str
        The same; what the command has no option for is left in Python's words.
    """
    options = _options.get()
    if "--displacement" not in options and "--drive" not in options:
        for python, words in IN_THE_HEADER:
            text = re.sub(python, words, text)
    if "--resample" not in options:
        text = re.sub(r"; resample= puts it [^;]*", "", text)
    if "--missing" not in options:
        text = re.sub(r"; missing='drop' leaves .*", "", text)
    text = text.replace(", or largest_saturation=0.5 or more", "")
    for python, option, needed in ADVICE:
        if needed in options:
            text = re.sub(python, option, text)
    # An option at the end of a sentence or before a comma.
    return re.sub(r"(--[a-z-]+) (?=[,;:)\n]|\.(?:\s|$)|$)", r"\1", text)
