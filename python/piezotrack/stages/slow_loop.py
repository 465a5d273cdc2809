"""The slow loop of a stage over a range of its drive: gain and width of the hysteresis."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from .base import Stage

__all__ = ["SlowLoop"]

# Voltages on each branch at which its displacement is computed.
POINTS = 65


@dataclass(frozen=True, kw_only=True)
class SlowLoop:
    """Closed loop of displacement over drive, so slow that no dynamics show.

    ::

        gain = (x(high) - x(low)) / (high - low),    width = max |x_down(u) - x_up(u)|

    Attributes
    ----------
    low, high : float
        Ends of the drive [V].
    travel : float
        Displacement at `high` less that at `low` [m].
    width : float
        Largest distance between the two branches at one drive [m].

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=[10.0], weights=[0.5e-6])
    >>> loop = pt.stages.SlowLoop.of(stage, 0.0, 100.0)
    >>> print(f"{1e6 * loop.gain:.3g} um/V, {1e6 * loop.width:.3g} um wide")
    1.4 um/V, 10 um wide
    """

    low: float
    high: float
    travel: float
    width: float

    @classmethod
    def of(cls, stage: Stage, low: float, high: float) -> SlowLoop:
        """Compute the loop of a stage from equilibria, without its creep.

        Parameters
        ----------
        stage : Stage
            The stage.
        low, high : float
            Ends of the drive [V].

        Returns
        -------
        SlowLoop
            The loop after one cycle between the ends.

        Raises
        ------
        ParameterError
            One of the ends is not a finite number.
        NumericalError
            The stage has no equilibrium there.
        """
        plain: Any = replace(stage, creep_weights=(), creep_times=())  # type: ignore[type-var]
        voltages = np.linspace(low, high, POINTS)
        up = np.array([plain.equilibrium([low, high, low, one]).x for one in voltages])
        down = np.array([plain.equilibrium([low, high, low, high, one]).x for one in voltages])
        return cls(
            low=float(low),
            high=float(high),
            travel=float(up[-1] - up[0]),
            width=float(np.abs(down - up).max()),
        )

    @property
    def gain(self) -> float:
        """Travel over the range of the drive [m/V]."""
        return self.travel / (self.high - self.low) if self.high != self.low else math.nan

    @property
    def width_percent(self) -> float:
        """Width in per cent of the travel."""
        return 100.0 * self.width / abs(self.travel) if self.travel else math.nan
