"""How an identification is run: what its result does not depend on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ... import _core
from ..._support.messages import quoted
from ...errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..fitted.estimates import Progress

__all__ = ["Run"]


@dataclass(frozen=True, kw_only=True)
class Run:
    """How an identification is run.

    Attributes
    ----------
    threads : int
        Up to 256; all cores where it is 0.
    progress : bool or None
        Whether progress is shown; a bar only where it is None.
    callback : callable or None
        Called with a `Progress` after every iteration of a search.
    checkpoint : _core.Checkpoint or None
        What a search keeps its simulations in.
    stopped : callable or None
        Whether least squares are to stop: those in a thread, which Ctrl-C does not reach.

    Raises
    ------
    ParameterError
        `threads` is no count, or `callback` is no function.
    """

    threads: int = 0
    progress: bool | None = None
    callback: Callable[[Progress], object] | None = None
    checkpoint: _core.Checkpoint | None = None
    stopped: Callable[[], bool] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "threads", _core.as_count("threads", self.threads))
        if self.callback is not None and not callable(self.callback):
            raise ParameterError("callback", quoted(self.callback), "a function, or None")
