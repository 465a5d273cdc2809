"""Text of a contouring run."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..loop.contouring import spread_text

if TYPE_CHECKING:
    from ..loop.contouring import Contour

__all__ = ["contour_text"]


def contour_text(run: Contour) -> str:
    """Write the contour error of a run, and the metrics of each axis."""
    since = f"from {run.settled:g} s on" if run.settled else "all of it"
    return "\n".join(
        [
            f"{run.path!r} at {1.0 / run.x.controller.dt:g} Hz; {run.x.note}",
            *(f"note  {note}" for note in run.notes),
            f"contour error {since}, signed, positive to the left of the path",
            f"  measured: {spread_text(run.metrics)}",
            f"  true, between the samples too: {spread_text(run.score(true=True))}",
            f"x: {run.x.metrics}",
            f"y: {run.y.metrics}",
        ]
    )
