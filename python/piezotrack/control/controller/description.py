"""A controller and its run in words: titles of pictures, and what is printed of objects."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..._support.plot_style import literal
from ..._support.units import best_length_unit, shown_unit

if TYPE_CHECKING:
    from ...references.reference import Reference
    from .controller import Controller

__all__ = ["controller_text", "parts_text", "run_text"]


def parts_text(controller: Controller) -> str:
    """Name the parts of a controller, as in 'feedforward (Prandtl-Ishlinskii) + PID'."""
    parts = []
    if controller.feedforward is not None:
        parts.append(f"feedforward ({controller.feedforward.stage.info.title})")
    if controller.feedback is not None:
        parts.append(controller.feedback.info.title)
    if controller.repetitive is not None:
        parts.append(controller.repetitive.info.title)
    return " + ".join(parts) or "no control"


def controller_text(controller: Controller) -> str:
    """Write a controller in a line, as its repr."""
    low, high = controller.limits
    filters = f", {len(controller.filters)} filters" if controller.filters else ""
    unit, scale = shown_unit(controller.drive_unit)
    return (
        f"Controller({parts_text(controller)}, {1.0 / controller.dt:.6g} Hz, "
        f"{scale * low:g} to {scale * high:g} {unit}{filters})"
    )


def run_text(controller: Controller, reference: Reference) -> str:
    """Write what followed what, as the title of a picture."""
    unit, scale = best_length_unit(max(abs(reference.low), abs(reference.high)))
    what = f"{literal(reference.name)}, {scale * reference.low:.4g} to {scale * reference.high:.4g}"
    return f"{what} {unit}: {parts_text(controller)} at {1.0 / controller.dt:.6g} Hz"
