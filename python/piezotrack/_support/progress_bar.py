"""A progress bar that is silent in a library and shown in a terminal or notebook."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from types import TracebackType

    from rich.console import Console

__all__ = ["ProgressBar", "console"]


def console() -> Console:
    """Make the console of progress bars: stderr, without the escapes of the command's own."""
    from rich.console import Console

    return Console(file=getattr(sys.stderr, "unescaped", None), stderr=True)


class ProgressBar:
    """Shows the iterations of a search and its best cost on stderr.

    Parameters
    ----------
    show : bool or None
        None: in a terminal or notebook only.
    """

    def __init__(self, show: bool | None) -> None:
        place = console()
        looking = place.is_terminal or place.is_jupyter
        self._bar = None
        if looking if show is None else show:
            from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

            self._bar = Progress(
                TextColumn("searching"),
                BarColumn(),
                TextColumn("{task.completed:.0f} of at most {task.total:.0f} iterations"),
                TextColumn("best {task.fields[cost]} um"),
                TimeElapsedColumn(),
                console=place,
                transient=True,
            )
            self._task = self._bar.add_task("search", total=1.0, cost="-")

    @property
    def update(self) -> Updater | None:
        """Callback for the core; None where nothing is shown."""
        return None if self._bar is None else self._update

    def _update(self, nit: int, most: int, nfev: int, cost: float, theta: list[float]) -> None:
        del nfev, theta
        if self._bar is not None:
            self._bar.update(self._task, completed=nit, total=most, cost=f"{1e6 * cost:.4g}")

    def __enter__(self) -> ProgressBar:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        del kind, error, trace
        if self._bar is not None:
            self._bar.stop()


if TYPE_CHECKING:
    from collections.abc import Callable

    Updater = Callable[[int, int, int, float, list[float]], None]
