"""Fig. 4 and equations (4) to (13): the step test and the identification from it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...identification.experiments.step_response import StepResult, identify_step

if TYPE_CHECKING:
    from ..apparatus import Apparatus

__all__ = ["observe", "step_test"]

RATE, VOLTS = 5000.0, 75.0
# Long enough for the ringing to decay, and not longer because of creep.
BEFORE, AFTER = 0.02, 0.3


def step_test(apparatus: Apparatus) -> StepResult:
    """Step to the full voltage, and identify from the response."""
    u = np.concatenate([np.zeros(int(RATE * BEFORE)), np.full(int(RATE * AFTER), VOLTS)])
    return identify_step(apparatus.x.record(u, 1.0 / RATE, hold="zoh"))


def observe(step: StepResult) -> dict[str, float]:
    """Compute the published quantities, SI."""
    read = step.readings
    # A step that does not overshoot twice has no second peak.
    peaks = (*read.peaks, read.steady_state, read.steady_state)
    return {
        "step.steady": read.steady_state,
        "step.peak_1": peaks[0],
        "step.peak_2": peaks[1],
        "step.period": read.period,
        "step.frequency": read.frequency,
        "step.zeta": step.damping_ratio,
    }
