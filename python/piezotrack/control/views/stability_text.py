"""Text of a loop's stability."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..loop.stability import LoopReport

__all__ = ["loop_text"]


def loop_text(report: LoopReport) -> str:
    """Write stability and margins at the lowest, a middle and the highest gain."""
    lines = [f"{name:<7} {case}" for name, case in report.cases]
    if report.middle.hint:
        lines.append(f"hint: {report.middle.hint}")
    if report.holds_state:
        lines.append(
            "antiwindup: no gain of back-calculation is stable; the state is held while the "
            "command is clipped"
        )
    return "\n".join(lines)
