"""Chatter of a command: how much it changes from sample to sample, and how fast."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..._support.arguments import expect, not_negative
from ...errors import ParameterError
from .tracking import Tracking

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Chatter", "chatter", "chatter_of"]


@dataclass(frozen=True, kw_only=True)
class Chatter:
    """How much a voltage chatters.

    Attributes
    ----------
    rms_change : float
        Rms of its change from sample to sample [V].
    fast_share : float
        Share of the power of these changes above a quarter of the sampling rate, 0 to 1.
    """

    rms_change: float
    fast_share: float

    @property
    def fast_change(self) -> float:
        """Rms of the changes above a quarter of the sampling rate [V]."""
        return self.rms_change * math.sqrt(self.fast_share)


def chatter(run: Tracking, *, after: float = 0.0) -> Chatter:
    """Measure how much the voltage of a run chatters.

    Parameters
    ----------
    run : Tracking
        Tracked motion.
    after : float, optional
        Time from which it counts [s], as the loop has to settle first.

    Returns
    -------
    Chatter
        Rms of the change of the voltage in a sample, and its share at high frequencies.

    Raises
    ------
    ParameterError
        `after` leaves fewer than 16 samples.

    Examples
    --------
    >>> import piezotrack as pt
    >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
    >>> reference = pt.sine(frequency=0.2, low=10e-6, high=40e-6, duration=10.0)
    >>> run = pt.track(pt.VirtualStage.xu_li_2010(), loop, reference)
    >>> pt.control.chatter(run, after=5.0).rms_change < 1.0
    True
    """
    expect("run", run, Tracking, "what pt.track returns")
    after = not_negative("after", after, "s")
    volts = np.asarray(run.voltage)[np.asarray(run.t) >= after]
    if volts.size < 16:
        raise ParameterError(
            "after", f"{after:g} s, which leaves {volts.size} samples", "16 or more"
        )
    return chatter_of(volts)


def chatter_of(volts: NDArray[np.float64]) -> Chatter:
    """Measure how much a voltage chatters.

    Parameters
    ----------
    volts : ndarray, shape (n,)
        The voltage at the samples [V], two or more.

    Returns
    -------
    Chatter
        Rms of the change of the voltage in a sample, and its share at high frequencies.
    """
    changes = np.diff(volts)
    power = np.abs(np.fft.rfft(changes)) ** 2
    total = float(power.sum())
    fast = float(power[np.fft.rfftfreq(changes.size) > 0.25].sum())
    rms = float(np.sqrt(np.mean(changes**2)))
    return Chatter(rms_change=rms, fast_share=fast / total if total > 0.0 else 0.0)
