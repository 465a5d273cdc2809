"""Timing of a closed loop: its delay, its jitter, and the voltages before a run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from .. import _core
from .._support.arguments import one_or_more_numbers

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["Timing"]


@dataclass(frozen=True, kw_only=True)
class Timing:
    """When the controller of a simulated loop acts, and from where a run begins.

    Parameters
    ----------
    delay : float, optional
        Time from a reading to the effect of its voltage [s], in addition to the hold.
    jitter : float, optional
        Mean sampling jitter [s], as on a computer without real-time scheduling: the delay of each
        sample is drawn from an exponential distribution, truncated at nine tenths of the sampling
        interval. The draws depend on the seed of the stage's sensor.
    voltages_before : sequence of float, optional
        Voltages that the stage visits slowly before the run, in turn [V]: it begins in equilibrium
        at the last, with the memory of the others, as ``(75.0, 0.0)``. By default it never moved
        before; where 0 V is not between the limits, it begins at the limit nearest to 0 V. Not with
        a virtual stage that is preconditioned.

    Raises
    ------
    ParameterError
        A value is no number. One that is out of its range is refused by what takes the timing.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.Timing(delay=2e-3, voltages_before=(75, 0))
    Timing(delay=0.002, jitter=0.0, voltages_before=(75.0, 0.0))
    """

    delay: float = 0.0
    jitter: float = 0.0
    voltages_before: Sequence[float] = ()

    def __post_init__(self) -> None:
        for name in ("delay", "jitter"):
            object.__setattr__(self, name, _core.as_number(name, getattr(self, name)))
        before = one_or_more_numbers("voltages_before", self.voltages_before)
        object.__setattr__(self, "voltages_before", before)
