"""Errors as a person reads them: one sentence on stderr, and an exit code."""

from __future__ import annotations

import os
import re
import sys
from functools import wraps
from typing import TYPE_CHECKING, ParamSpec

import typer

from ..errors import PiezotrackError

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["in_words"]

BAD_INPUT = 2
INTERRUPTED = 130
NOT_PRINTED = 1

P = ParamSpec("P")


def in_words(command: Callable[P, None]) -> Callable[P, None]:
    """Turn the exceptions of piezotrack into one sentence and an exit code."""

    @wraps(command)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        try:
            command(*args, **kwargs)
            sys.stdout.flush()
        except PiezotrackError as error:
            print(f"piezotrack: {_as_options(str(error))}", file=sys.stderr)
            raise typer.Exit(BAD_INPUT) from None
        except KeyboardInterrupt as error:
            print(f"piezotrack: {str(error) or 'interrupted'}", file=sys.stderr)
            raise typer.Exit(INTERRUPTED) from None
        except OSError as error:
            # All results have been written before anything is printed.
            if not isinstance(error, BrokenPipeError):
                print(f"piezotrack: cannot print: {error.strerror}", file=sys.stderr)
            # Discard the rest of the output, or Python would report an error when it exits.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(NOT_PRINTED) from None

    return run


# Advice of the library in Python, and the option that does the same.
ADVICE = [
    (
        re.compile(r"time=0, drive=1, displacement=2, units=\{0: 's', 1: 'V', 2: 'um'\}"),
        "--time 0 --drive 1 --displacement 2 --unit 0=s --unit 1=V --unit 2=um",
    ),
    (re.compile(r"units=\{'?(\w+)'?: \.\.\.\}"), r"--unit \1=..."),
    (re.compile(r"\bfixed="), "--fix"),
    (re.compile(r"\bbeyond_reach=True"), "--beyond-reach"),
    (re.compile(r"\bunstable=True"), "--unstable"),
    (re.compile(r"pt\.\w+\.from_um\(k[pq]=.*\)"), "a value in V/um"),
    (
        re.compile(r"(?<!--unit )\b(time|drive|displacement|dt|stiffness|runs|train|test)=(?!\d)"),
        r"--\1",
    ),
]


def _as_options(sentence: str) -> str:
    for python, option in ADVICE:
        sentence = python.sub(option, sentence)
    return sentence
