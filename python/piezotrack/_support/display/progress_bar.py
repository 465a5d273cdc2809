"""Progress on stderr: a bar in a terminal or notebook, lines of words elsewhere on request."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from importlib import import_module
from threading import Event, Thread
from typing import TYPE_CHECKING, Any

from .progress_parts import part_at_work

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from types import TracebackType
    from typing import Self, TextIO

    from rich.console import Console

    Updater = Callable[[int, int, int, float, list[float], float], None]

__all__ = ["ProgressBar", "console", "one_clock"]

# Seconds before the first line of words, and between two.
FIRST, EVERY = 3.0, 5.0
# Seconds before the first line in a notebook, and between two; and its bar.
SOON, OFTEN = 0.5, 0.2
WIDE, BLOCK, SHADE = 16, "\N{FULL BLOCK}", "\N{LIGHT SHADE}"


def console() -> Console:
    """Make the console of progress bars: stderr, without the escapes of the command's own."""
    from rich.console import Console

    return Console(file=getattr(sys.stderr, "unescaped", None), stderr=True)


class _Clock:
    """Says when the next line is due, to all computations of one command."""

    def __init__(self) -> None:
        self._begun = time.monotonic()
        self._due = self._begun + FIRST

    @property
    def elapsed(self) -> float:
        """Seconds since the first computation began."""
        return time.monotonic() - self._begun

    @property
    def wait(self) -> float:
        """Seconds until the next line is due."""
        return max(0.0, self._due - time.monotonic())

    def postpone(self) -> None:
        """Put the next line off."""
        self._due = time.monotonic() + EVERY


_clock: ContextVar[_Clock | None] = ContextVar("_clock", default=None)


@contextmanager
def one_clock() -> Iterator[None]:
    """Count the time of all computations within together.

    Yields
    ------
    None
    """
    token = _clock.set(_Clock())
    try:
        yield
    finally:
        _clock.reset(token)


class ProgressBar:
    """Shows how far a computation is, on stderr.

    Parameters
    ----------
    show : bool or None
        None: in a terminal or notebook only. True: elsewhere too, as a line every few seconds.
    task : str
        What is computed, as ``"identify: dahl"``.
    """

    def __init__(self, show: bool | None, task: str) -> None:
        self._view: _Bar | _Cell | _Words | None = None
        self._part = part_at_work()
        if show is not None and not show:
            return
        place = console()
        if place.is_jupyter:
            self._view = _Cell(task)
        elif place.is_terminal:
            self._view = _Bar(place, task)
        elif show:
            self._view = _Words(sys.stderr, task)

    @property
    def update(self) -> Updater | None:
        """Callback for the core; None where nothing is shown."""
        return None if self._view is None else self._update

    def _update(
        self, nit: int, most: int, nfev: int, cost: float, theta: list[float], delay: float
    ) -> None:
        del nfev, theta, delay
        self.step(nit, most, f"at most {most} iterations, best {1e6 * cost:.3g} um")

    def step(self, done: int, total: int, words: str) -> None:
        """Show what has been done.

        Parameters
        ----------
        done, total : int
            Parts of the computation; a total of 0 where they are not known.
        words : str
            Of what, as ``"20 seeds"``.
        """
        if self._view is not None:
            share = done / total if total else 0.0
            said = ", ".join(filter(None, (self._part.words(share), words)))
            self._view.step(self._part.share(share), said)

    def __enter__(self) -> Self:
        if self._view is not None:
            # What reports nothing inside is a part all the same.
            self._view.start(self._part.share(0.0), self._part.words(0.0))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        del kind, error, trace
        if self._view is not None:
            self._view.stop()


class _Bar:
    """A bar that is redrawn, and removed at the end."""

    def __init__(self, place: Console, task: str) -> None:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        self._bar = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=16),
            TextColumn("{task.fields[words]}", markup=False),
            TimeElapsedColumn(),
            console=place,
            transient=True,
        )
        self._task = self._bar.add_task(task, total=None, words="")

    def start(self, share: float, words: str) -> None:
        """Draw a later part."""
        if share:
            self.step(share, words)

    def stop(self) -> None:
        self._bar.stop()

    def step(self, share: float, words: str) -> None:
        self._bar.start()
        self._bar.update(self._task, completed=share, total=1.0 if share else None, words=words)


class _Cell:
    """A line below the cell of a notebook, which is empty at the end.

    The widgets of rich stay in the notebook, empty.
    """

    def __init__(self, task: str) -> None:
        self._task = task
        self._handle: Any = None
        self._due = time.monotonic() + SOON

    def start(self, share: float, words: str) -> None:
        self.step(share, words)

    def stop(self) -> None:
        if self._handle is not None:
            self._handle.update({"text/html": ""}, raw=True)

    def step(self, share: float, words: str) -> None:
        if time.monotonic() < self._due:
            return
        # IPython is there in a notebook, and is not needed for anything else.
        display: Any = import_module("IPython.display").display
        self._due = time.monotonic() + OFTEN
        filled = round(WIDE * share)
        bar = f"{filled * BLOCK}{(WIDE - filled) * SHADE}"
        line = {"text/plain": "  ".join(filter(None, (self._task, bar, words)))}
        if self._handle is None:
            self._handle = display(line, raw=True, display_id=True)
        else:
            self._handle.update(line, raw=True)


class _Words:
    """Lines, written by a thread of their own: least squares call nothing while they compute."""

    def __init__(self, stream: TextIO, task: str) -> None:
        self._stream, self._task, self._words = stream, task, ""
        self._clock = _clock.get() or _Clock()
        self._ended = Event()

    def start(self, share: float, words: str) -> None:
        self.step(share, words)
        Thread(target=self._write, daemon=True).start()

    def stop(self) -> None:
        self._ended.set()

    def step(self, share: float, words: str) -> None:
        del share
        self._words = words

    def _write(self) -> None:
        while not self._ended.wait(self._clock.wait):
            parts = [self._task, self._words, f"{self._clock.elapsed:.0f} s"]
            # Nobody may be there to read it any more.
            with suppress(OSError, ValueError):
                print(", ".join(filter(None, parts)), file=self._stream, flush=True)
            self._clock.postpone()
