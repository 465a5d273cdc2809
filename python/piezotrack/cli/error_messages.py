"""Errors as a person reads them: one sentence on stderr, and an exit code."""

from __future__ import annotations

import errno
import os
import re
import sys
from contextlib import suppress
from functools import wraps
from typing import TYPE_CHECKING, ParamSpec

import click

from .._support.display.progress_bar import one_clock
from ..errors import PiezotrackError
from .advice import as_options, command_at_work
from .process.interruption import at_rest, at_work, exit_code, stopped
from .process.pictures import prepare_pictures
from .process.terminal import one_line

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["of_the_system", "report_errors", "say"]

BAD_INPUT = 2
NOT_PRINTED = 1
# As of a process that SIGPIPE ends: 128 + 13.
READER_LEFT = 141

# Reasons for which the output cannot be printed.
OUTPUT = (errno.ENOSPC, errno.EIO, errno.EBADF, errno.EDQUOT, errno.EFBIG)

CODEC = re.compile(r"^(?:de|en)coding with '[^']*' codec failed \(KeyboardInterrupt: ([^)]*)\)")

P = ParamSpec("P")


def report_errors(command: Callable[P, None]) -> Callable[P, None]:
    """Turn the exceptions of piezotrack into one sentence and an exit code."""

    @wraps(command)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        context = click.get_current_context(silent=True)
        command_at_work.set(context.command if context else None)
        try:
            prepare_pictures()
            with at_work(), one_clock():
                command(*args, **kwargs)
                sys.stdout.flush()
        except KeyboardInterrupt as error:
            code = _stopped(error)
        except Exception as error:
            if stopped():
                # A module that was being imported has turned the interruption into another error.
                code = _stopped(KeyboardInterrupt())
            elif isinstance(error, PiezotrackError):
                say(as_options(error))
                code = BAD_INPUT
            elif isinstance(error, MemoryError):
                say(str(error) or "not enough memory")
                code = BAD_INPUT
            elif isinstance(error, OSError):
                code = of_the_system(error)
            else:
                raise
        else:
            return
        raise click.exceptions.Exit(code)

    return run


def say(sentence: str) -> None:
    """Print one sentence on stderr."""
    # There is nowhere to say that it cannot be said.
    with suppress(OSError):
        print(f"piezotrack: {one_line(sentence)}", file=sys.stderr, flush=True)


def _stopped(error: KeyboardInterrupt) -> int:
    at_rest()
    # A codec at work puts what interrupts it into a sentence of its own.
    say(CODEC.sub(r"\1", str(error)) or "interrupted")
    return exit_code()


def of_the_system(error: OSError) -> int:
    """Say which file an error is about, or that nothing can be printed."""
    reason = (error.strerror or str(error)).lower()
    if error.filename is not None:
        say(f"{error.filename}: {reason}")
        return BAD_INPUT
    # Without a file it is the output, printed when all results have been written. The rest of it is
    # discarded, or Python would report an error when it exits.
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    if isinstance(error, BrokenPipeError):
        return READER_LEFT
    say(f"cannot print: {reason}" if error.errno in OUTPUT else reason)
    return NOT_PRINTED
