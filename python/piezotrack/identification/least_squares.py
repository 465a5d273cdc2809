"""Identification of a Prandtl-Ishlinskii stage."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from .. import _core
from .._support.arguments import as_numbers
from ..data.dataset import Dataset
from ..errors import DataError, ParameterError
from ..stages.prandtl_ishlinskii import PlaysResponse, PrandtlIshlinskiiStage
from .identified import Fitted
from .model_file import IdentifiedPlays, provenance

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["PlaysIdentification", "identify_plays"]

MOST_PLAYS, MOST_ZONES, MOST_RELAXATIONS = 32, 8, 8


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class PlaysIdentification(Fitted[PlaysResponse], IdentifiedPlays):
    """What a fit found; see `IdentifiedPlays` for what can be done with it.

    Attributes
    ----------
    nfev : int
        Simulations of the record.
    at_bound : bool
        Whether a time constant or a frequency lies on the edge of what was searched.
    """

    nfev: int
    at_bound: bool

    @property
    def notes(self) -> list[str]:
        """What a careful reader should know before using the result."""
        notes = self._remarks([])
        if self.at_bound:
            notes.append("the record does not fix the dynamics: they lie on the edge of the search")
        if self.model.linear + sum(self.model.weights) > 100.0 * self.model.linear:
            notes.append("hardly any motion just after a reversal: the inverse is ill-conditioned")
        return notes

    def summary(self) -> str:
        """Table of the result.

        Returns
        -------
        str
            Several lines: the cost, then the parameters.
        """
        from .report import plays_text

        return plays_text(self)


def identify_plays(
    data: Dataset,
    *,
    count: int = 10,
    thresholds: Sequence[float] | None = None,
    asymmetry: bool | int = True,
    creep: bool | Sequence[float] = False,
    dynamics: Literal["first", "second"] | None = "first",
    offset: bool = True,
) -> PlaysIdentification:
    """Identify a Prandtl-Ishlinskii stage.

    Weights, dead zones, shares of the creep and the offset are found by Gauss and Newton's
    method, whose steps are non-negative least squares (Lawson and Hanson 1974); without dead
    zones and creep one step is all there is to it, as in Kuhnen 2003, doi
    10.3166/ejc.9.407-418. A time constant, or the frequency and damping of a mode, is searched by
    golden section. Nothing is random.

    Parameters
    ----------
    data : Dataset
        The record. The drive before its window is warm-up: simulated, not scored.
    count : int, optional
        Number of plays, 1 to 32, with thresholds spread evenly up to half of the drive's range.
    thresholds : sequence of float, optional
        Thresholds [V] of one's own, in place of `count`.
    asymmetry : bool or int, optional
        Number of one-sided dead zones, 0 to 8, spread evenly over the displacement; True stands
        for 2.
    creep : bool or sequence of float, optional
        Time constants of the creep [s]; True stands for the powers of ten between five samples
        and half of the window.
    dynamics : {"first", "second"} or None, optional
        A first-order lag, which also stands in for a reading that comes late; a mode, between a
        fiftieth and a half of the sampling rate; or none.
    offset : bool, optional
        Whether the sensor may show something where the stage is at rest without drive.

    Returns
    -------
    PlaysIdentification
        The stage and how well it follows.

    Raises
    ------
    ParameterError
        An argument is out of its range.
    DataError
        The record tells nothing: its drive or its displacement stays where it is, the drive never
        reverses, the displacement falls as the drive rises, or the window is too short.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6]
    ... )
    >>> u = 37.5 * (1 - np.cos(np.arange(2000) / 100.0))
    >>> log = pt.Dataset(u=u, y=stage.simulate(u, 0.01).x, dt=0.01)
    >>> fit = pt.identification.identify_plays(
    ...     log, thresholds=[5.0, 10.0, 20.0], asymmetry=False, dynamics=None
    ... )
    >>> print(", ".join(f"{1e6 * weight:.3f}" for weight in fit.model.weights), "um/V")
    0.000, 0.200, 0.100 um/V
    """
    if not isinstance(data, Dataset):
        raise ParameterError(f"data is {type(data).__name__}: expected a Dataset")
    if dynamics not in (None, "first", "second"):
        raise ParameterError(f"dynamics is {dynamics!r}: expected None, 'first' or 'second'")
    _core.as_truth("offset", offset)
    places = _thresholds(data, count, thresholds)
    zones = 2 if asymmetry is True else 0 if asymmetry is False else _zones(asymmetry)
    times = _times(data, creep)
    found = _core.identify_plays(
        u=data.full.u,
        y=data.full.y,
        dt=data.dt,
        hold_name=data.hold,
        start=data.warmup,
        thresholds=places,
        zones=zones,
        creep_times=times,
        dynamics=dynamics or "none",
        offset=offset,
    )
    frequency, damping_ratio = found.mode or (None, None)
    model = PrandtlIshlinskiiStage(
        linear=found.linear,
        thresholds=places,
        weights=tuple(found.weights),
        corners=tuple(found.corners),
        bends=tuple(found.bends),
        creep_shares=tuple(found.creep_shares),
        creep_times=times,
        time_constant=found.time_constant,
        frequency=frequency,
        damping_ratio=damping_ratio,
    )
    fit = {"cost": {"value": found.rms, "unit": "m"}, "simulations": found.evaluations}
    return PlaysIdentification(
        model=model,
        offset=found.offset,
        offset_fitted=offset,
        stroke=data.stroke,
        details={"fit": fit, "provenance": provenance(data)},
        data=data,
        cost=found.rms,
        nfev=found.evaluations,
        at_bound=found.at_bound,
    )


def _thresholds(data: Dataset, count: object, given: object) -> tuple[float, ...]:
    if given is not None:
        return as_numbers("thresholds", given)
    number = _core.as_count("count", count)
    if not 1 <= number <= MOST_PLAYS:
        raise ParameterError(f"count is {number}: expected 1 to {MOST_PLAYS} plays")
    reach = 0.5 * float(np.ptp(data.full.u))
    return tuple((reach * np.arange(1, number + 1) / (number + 1)).tolist())


def _zones(asymmetry: object) -> int:
    zones = _core.as_count("asymmetry", asymmetry)
    if zones > MOST_ZONES:
        raise ParameterError(f"asymmetry is {zones}: expected up to {MOST_ZONES} dead zones")
    return zones


def _times(data: Dataset, creep: object) -> tuple[float, ...]:
    if creep is False:
        return ()
    if creep is not True:
        return as_numbers("creep", creep)
    shortest, longest = 5.0 * data.dt, 0.5 * data.duration
    decades = [10.0**k for k in range(-9, 10) if shortest <= 10.0**k <= longest]
    if not decades:
        raise DataError(
            f"the window of {data.duration:.4g} s is too short to show creep: expected at least "
            f"{20.0 * shortest:.4g} s, or creep=False"
        )
    return tuple(decades[-MOST_RELAXATIONS:])
