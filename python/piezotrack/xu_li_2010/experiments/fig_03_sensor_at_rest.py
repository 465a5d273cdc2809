"""Fig. 3: the sensor at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...identification.experiments.sensor_noise import Noise, identify_noise

if TYPE_CHECKING:
    from ..apparatus import Apparatus

__all__ = ["at_rest", "observe"]

RATE, SECONDS = 5000.0, 10.0


def at_rest(apparatus: Apparatus) -> Noise:
    """Record the sensor with the stage at rest."""
    return identify_noise(apparatus.x.record(np.zeros(int(RATE * SECONDS)), 1.0 / RATE))


def observe(noise: Noise) -> dict[str, float]:
    """Compute the published quantities, SI."""
    return {"rest.rms": noise.rms, "rest.step": noise.resolution}
