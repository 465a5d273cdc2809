"""Sliding mode control with perturbation estimation."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..._support.arguments import expect
from ..parts.part import FeedbackLaw, part
from .sliding_mode import SlidingMode

__all__ = ["PerturbationEstimator"]


@part("perturbation-estimator")
@dataclass(frozen=True, kw_only=True)
class PerturbationEstimator(FeedbackLaw):
    r"""Sliding mode control with perturbation estimation.

    The disturbance observer of `DisturbanceObserver` around a `SlidingMode`: the estimate takes the
    place of most of the switching gain, so less of it is needed, and less chatter remains. After
    Elmali and Olgac 1992. `check_loop` and `to_control` take it inside the boundary layer, exactly.

    Parameters
    ----------
    sliding : SlidingMode
        The law inside.
    plant_gain : float
        Static gain g of the nominal plant [m/V], not 0.
    plant_time : float, optional
        Its time constant T [s].
    cutoff : float, optional
        Cutoff of the filter of the estimate [Hz], above 0; by default none, as in the source.

    Raises
    ------
    ParameterError
        A number is out of its range, or `sliding` is no `SlidingMode`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> sliding = pt.control.SlidingMode(switching=1.0, layer=20e-6)
    >>> law = pt.control.PerturbationEstimator(sliding=sliding, plant_gain=1.5e-6, cutoff=1.0)
    >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=law)
    >>> pt.check_loop(pt.VirtualStage.xu_li_2010(), loop).stable
    True
    """

    sliding: SlidingMode
    plant_gain: float
    plant_time: float = 0.0
    cutoff: float = math.inf

    def __post_init__(self) -> None:
        expect("sliding", self.sliding, SlidingMode, "pt.control.SlidingMode")
        super().__post_init__()
