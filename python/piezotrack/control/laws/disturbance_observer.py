"""Disturbance observer around a PID."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..._support.arguments import expect
from ...errors import ParameterError
from ..parts.part import FeedbackLaw, part
from .pid import Pid

__all__ = ["DisturbanceObserver"]


@part("disturbance-observer")
@dataclass(frozen=True, kw_only=True)
class DisturbanceObserver(FeedbackLaw):
    r"""Disturbance observer around a PID.

    .. math::

        \hat d = Q\,(G_n^{-1} (y - r) - (u - u_{FF})), \qquad u_{FB} = u_{PID} - \hat d, \qquad
        G_n = \frac{g}{1 + s T}, \quad Q = \frac{1}{1 + s/\omega_c}

    After Ohnishi, and Yi, Chang and Shen 2009 for piezo hysteresis, which is the disturbance of a
    linear plant. Here plant and voltage are counted from reference and feedforward, so that what
    an inverse compensates is not compensated twice. The voltage is the one that was applied, and
    while it is clipped the estimate takes no step further out. `check_loop` and `to_control` take
    the law exactly: the observer adds an integrator of bandwidth omega_c.

    Parameters
    ----------
    pid : Pid
        The controller inside, with a finite integral time.
    plant_gain : float
        Static gain g of the nominal plant [m/V], not 0.
    plant_time : float, optional
        Its time constant T [s].
    cutoff : float
        Cutoff of Q [Hz], above 0; infinity for no filter.

    Raises
    ------
    ParameterError
        A number is out of its range, or `pid` is no `Pid`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> law = pt.control.DisturbanceObserver(
    ...     pid=pt.Pid.from_um(kp=0.05, ti=0.1), plant_gain=1.5e-6, cutoff=1.0
    ... )
    >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=law)
    >>> pt.check_loop(pt.VirtualStage.xu_li_2010(), loop).stable
    True
    """

    pid: Pid
    plant_gain: float
    plant_time: float = 0.0
    cutoff: float

    def __post_init__(self) -> None:
        expect("pid", self.pid, Pid, "pt.Pid")
        if math.isinf(self.pid.ti):
            raise ParameterError(
                "pid",
                "ti = inf",
                "a finite integral time, since the observer would keep the constant that an "
                "incremental PID starts with",
                verb="has",
            )
        super().__post_init__()
