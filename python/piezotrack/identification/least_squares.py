"""Identification by least squares, for models that are linear in the weights of their plays."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from .. import _core
from .._support.arguments import as_numbers
from .._support.messages import quoted
from ..errors import DataError, ParameterError
from ..stages.registry import stage_class
from .model_file import provenance
from .result import Identification

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..data.dataset import Dataset
    from ..stages.model_info import ModelInfo

__all__ = ["LeastSquares", "solve_least_squares"]

MOST_PLAYS, MOST_ZONES, MOST_RELAXATIONS = 32, 8, 8
# Parameters that the settings and the record fix beforehand.
CHOSEN = ("thresholds", "dead_zone_thresholds", "creep_times")


@dataclass(frozen=True, kw_only=True)
class LeastSquares:
    """Settings of an identification by least squares.

    The weights of plays, dead zones and creep and the offset are found by the Gauss-Newton method,
    each step of which is a non-negative least-squares problem (Lawson and Hanson 1974); without
    dead zones and creep a single step solves the problem, as in Kuhnen 2003, doi
    10.3166/ejc.9.407-418. A time constant, or the frequency and damping of a mode, is searched by
    golden section. Nothing is random.

    Parameters
    ----------
    count : int, optional
        Number of plays, 1 to 32, with thresholds spread evenly up to half of the drive's range.
    thresholds : sequence of float, optional
        Thresholds of the plays [V], in place of `count`.
    dead_zones : bool or int, optional
        Number of one-sided dead zones, 0 to 8, spread evenly over the displacement; True stands
        for 2, or for none where the model has no dead zones.
    creep : bool or sequence of float, optional
        Time constants of the creep [s]; True stands for the powers of ten between five samples
        and half of the window.
    dynamics : {"first", "second"} or None, optional
        ``"first"``: a first-order lag, which also approximates a delayed reading. ``"second"``: a
        mode, with a frequency between a fiftieth and a half of the sampling rate. None: neither.

    Raises
    ------
    ParameterError
        A setting is out of its range.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6]
    ... )
    >>> u = 37.5 * (1 - np.cos(np.arange(2000) / 100.0))
    >>> log = pt.Dataset(u=u, y=stage.simulate(u, 0.01).x, dt=0.01)
    >>> settings = pt.identification.LeastSquares(
    ...     thresholds=[5.0, 10.0, 20.0], dead_zones=False, dynamics=None
    ... )
    >>> fit = pt.identify(log, "prandtl-ishlinskii", least_squares=settings)
    >>> print(", ".join(f"{1e6 * weight:.3f}" for weight in fit.model.weights), "um/V")
    0.000, 0.200, 0.100 um/V
    """

    count: int = 10
    thresholds: Sequence[float] | None = None
    dead_zones: bool | int = True
    creep: bool | Sequence[float] = False
    dynamics: Literal["first", "second"] | None = "first"

    def __post_init__(self) -> None:
        count = _core.as_count("count", self.count)
        if not 1 <= count <= MOST_PLAYS:
            raise ParameterError(f"count is {count}: expected 1 to {MOST_PLAYS} plays")
        if self.thresholds is not None:
            object.__setattr__(self, "thresholds", as_numbers("thresholds", self.thresholds))
        if not isinstance(self.dead_zones, bool):
            zones = _core.as_count("dead_zones", self.dead_zones)
            if zones > MOST_ZONES:
                raise ParameterError(
                    f"dead_zones is {zones}: expected up to {MOST_ZONES} dead zones"
                )
        if not isinstance(self.creep, bool):
            object.__setattr__(self, "creep", as_numbers("creep", self.creep))
        if self.dynamics not in (None, "first", "second"):
            raise ParameterError(
                f"dynamics is {quoted(self.dynamics)}: expected None, 'first' or 'second'"
            )

    def _thresholds(self, data: Dataset) -> Sequence[float]:
        if self.thresholds is not None:
            return self.thresholds
        reach, count = 0.5 * float(np.ptp(data.full.u)), self.count
        spread: list[float] = (reach * np.arange(1, count + 1) / (count + 1)).tolist()
        return spread

    def _zones(self, info: ModelInfo) -> int:
        if self.dead_zones is True:
            return 2 if info.has_dead_zones else 0
        return int(self.dead_zones)

    def _times(self, data: Dataset) -> Sequence[float]:
        if not isinstance(self.creep, bool):
            return self.creep
        if not self.creep:
            return ()
        shortest, longest = 5.0 * data.dt, 0.5 * data.duration
        decades = [10.0**k for k in range(-9, 10) if shortest <= 10.0**k <= longest]
        if not decades:
            raise DataError(
                f"the window of {data.duration:.4g} s is too short to show creep: expected at "
                f"least {20.0 * shortest:.4g} s, or creep=False"
            )
        return decades[-MOST_RELAXATIONS:]


def solve_least_squares(
    data: Dataset, info: ModelInfo, settings: LeastSquares, offset: bool
) -> Identification:
    """Identify a stage by least squares.

    Parameters
    ----------
    data : Dataset
        The record. The drive before its window is warm-up: simulated, not scored.
    info : ModelInfo
        The model.
    settings : LeastSquares
        Settings.
    offset : bool
        Whether an offset of the sensor is fitted.

    Returns
    -------
    Identification
        The stage, and the residual of the fit.

    Raises
    ------
    DataError
        The record does not determine the weights: its drive or its displacement is constant, the
        drive never reverses, the displacement falls as the drive rises, or the window is too
        short.
    """
    found = _core.identify_weights(
        model=info.name,
        u=data.full.u,
        y=data.full.y,
        dt=data.dt,
        hold_name=data.hold,
        start=data.warmup,
        thresholds=list(settings._thresholds(data)),
        zones=settings._zones(info),
        creep_times=list(settings._times(data)),
        dynamics=settings.dynamics or "none",
        offset=offset,
    )
    details: dict[str, Any] = {
        "parameters": {
            one.name: {"free": one.name not in CHOSEN and one.held is None}
            for one in info.parameters
        },
        "fit": {
            "cost": {"value": found.rms, "unit": "m"},
            "simulations": found.evaluations,
            "at_bound": found.at_bound,
        },
        "provenance": provenance(data, least_squares=asdict(settings)),
    }
    return Identification(
        model=stage_class(info)._from(found.parameters),
        offset=found.offset,
        offset_fitted=offset,
        stroke=data.stroke,
        details=details,
        data=data,
        cost=found.rms,
        nfev=found.evaluations,
        stop_reason="solved",
        least_squares=settings,
        at_bound=found.at_bound,
    )
