"""The steps of the page, in their order."""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import log, loop, model, motion, use

if TYPE_CHECKING:
    from ..desk import Step

__all__ = ["PAGES"]

PAGES: dict[str, Step] = {
    "log": log.LogStep(),
    "model": model.ModelStep(),
    "motion": motion.MotionStep(),
    "loop": loop.LoopStep(),
    "use": use.UseStep(),
}
