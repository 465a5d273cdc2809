"""Ctrl-C and SIGTERM: one line, and the exit code that shells expect.

While a command is at work, either raises KeyboardInterrupt, so that temporary files are removed and
a search keeps its best model. Before and after that there is nothing to tidy up, and the process
ends at once: modules that are being imported may turn a KeyboardInterrupt into something else.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
from contextlib import contextmanager, suppress

# As type checkers read it; importing typing takes long.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

__all__ = [
    "acknowledge_interrupt",
    "answer_signals",
    "at_rest",
    "at_work",
    "exit_code",
    "leave_if_stopped",
    "stopped",
]

WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
# Time after which an interruption is repeated that is known to be lost, or that nobody has heard:
# library code may catch any exception, and a search that is just ending does not look [s].
LOST, UNHEARD = 0.01, 1.0

# The signal that came, and whether a command is at work.
_came: signal.Signals | None = None
_working = False


def answer_signals() -> None:
    """Answer the signals in this process, except those that it was started to ignore."""
    for number in WORDS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _answer)
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, _repeat)
    sys.unraisablehook = _not_raised


@contextmanager
def at_work() -> Iterator[None]:
    """Raise KeyboardInterrupt within when a signal comes."""
    global _came, _working
    _working = True
    try:
        yield
        # All is done, in spite of a signal that did not arrive.
        _came = None
    finally:
        at_rest()


def at_rest() -> None:
    """End the process at once when a signal comes from now on."""
    global _working
    _working = False
    # A repetition that comes late in the end of the process would kill it.
    acknowledge_interrupt()


def acknowledge_interrupt() -> None:
    """Declare that the interruption has arrived, and is not to be repeated."""
    _repeat_in(0.0)


def stopped() -> bool:
    """Return whether a signal came."""
    return _came is not None


def exit_code() -> int:
    """Return the exit code of a process that a signal stopped; Ctrl-C where none came."""
    return 128 + (signal.SIGINT if _came is None else _came)


def leave_if_stopped() -> None:
    """End the process without a wait for its memory, or for threads that still compute."""
    if stopped():
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        atexit._run_exitfuncs()
        os._exit(exit_code())


def _answer(number: int, frame: FrameType | None) -> None:
    global _came
    del frame
    _came = signal.Signals(number)
    if _working:
        _repeat_in(UNHEARD)
        raise KeyboardInterrupt(WORDS[_came])
    with suppress(OSError):
        os.write(2, f"piezotrack: {WORDS[_came]}\n".encode())
    os._exit(exit_code())


def _repeat(number: int, frame: FrameType | None) -> None:
    del number
    if _working and _came is not None:
        _answer(_came, frame)


def _repeat_in(seconds: float) -> None:
    # A thread could not be started within a handler; Windows has no other way.
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds)


def _not_raised(lost: sys.UnraisableHookArgs) -> None:
    """Repeat an interruption that fell into a callback of the interpreter, which cannot raise."""
    if _came is None or not issubclass(lost.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(lost)
    elif _working:
        _repeat_in(LOST)
