"""Gains over amplitude and rate of the reference."""

from __future__ import annotations

from collections.abc import Callable, Sequence, Sized
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ... import _core
from ..._support.units import shown_unit
from ...errors import ParameterError
from ...references.reference import Reference
from ...references.waveforms import sine
from ..components import Pid
from ..scheduled_pid import ScheduledPid
from .margins import Margins, Spread, plants_of
from .tune import tune

if TYPE_CHECKING:
    from ...identification.identified import IdentifiedModel
    from ..controller import Controller
    from ..plant import Plant
    from .tuned import Tuned

__all__ = ["Schedule", "schedule"]

# Periods along which a reference of the grid is followed: the first is its smooth start.
PERIODS = 4
# Excess of a margin that an interpolated set of gains may have.
SLACK = 0.05
Waveform = Callable[[float, float], Reference]


class Schedule(NamedTuple):
    """Scheduled gains beside one fixed set for all references.

    Attributes
    ----------
    controller : Controller
        With scheduled gains.
    fixed : Tuned
        One set of gains for all references of the grid.
    tuned : tuple of Tuned
        For each amplitude the gains at each rate.
    errors : ndarray, shape (amplitudes, rates, 2)
        Rms error with the fixed and with the scheduled gains [m].
    """

    controller: Controller
    fixed: Tuned
    tuned: tuple[Tuned, ...]
    errors: np.ndarray[Any, np.dtype[np.float64]]

    def __str__(self) -> str:
        law = self.controller.feedback
        assert isinstance(law, ScheduledPid)
        unit, scale = shown_unit(self.controller.drive_unit)
        lines = [
            f"amplitude um  rate Hz  kp {unit}/um    ti ms    td ms   rms um: fixed, scheduled"
        ]
        pairs = [(amplitude, rate) for amplitude in law.amplitudes for rate in law.rates]
        errors = self.errors.reshape(-1, 2)
        for (amplitude, rate), one, (before, after) in zip(pairs, law.gains, errors, strict=True):
            lines.append(
                f"{1e6 * amplitude:>12g} {rate:>8g} {1e-6 * scale * one.kp:>8.4g} "
                f"{1e3 * one.ti:>8.3g} {1e3 * one.td:>8.3g}   {1e6 * before:.4f}, {1e6 * after:.4f}"
            )
        return "\n".join(lines)


def schedule(
    stage: Plant | IdentifiedModel | Sequence[Plant | IdentifiedModel],
    amplitudes: Sequence[float],
    rates: Sequence[float],
    *,
    centre: float,
    waveform: Waveform | None = None,
    margins: Margins | None = None,
    spread: Spread | None = None,
    **options: Any,
) -> Schedule:
    """Tune PID gains at each amplitude and rate of a grid, for one controller without bumps.

    First one set of gains and filters is tuned for all references of the grid. Then, with those
    filters, the gains for each reference. Where none is better for it than the fixed set, that is
    taken. The margins hold at every place of the grid and half-way between neighbours, for every
    plant of the set.

    Parameters
    ----------
    stage : Stage, VirtualStage, IdentifiedModel, or a sequence of them
        As of `tune`.
    amplitudes : sequence of float
        Half of peak to peak [m], rising, 1 to 4.
    rates : sequence of float
        Frequencies [Hz], rising, 1 to 4.
    centre : float
        Middle of the references [m].
    waveform : callable, optional
        Makes the reference of an amplitude [m] and a rate [Hz]; default a sine of four periods
        about `centre`.
    margins, spread : optional
        As of `tune`.
    **options
        Further arguments of `tune`; `parts` is PID and low-pass by default, without a
        repetitive part.

    Returns
    -------
    Schedule
        The controller, the fixed set, and the errors with both.

    Raises
    ------
    ParameterError
        As of `tune`; gains between two places of the grid do not keep the margins.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.VirtualStage.xu_li_2010(seed=1)
    >>> found = pt.schedule(
    ...     stage, [10e-6, 40e-6], [0.2], centre=58e-6, dt=0.02, limits=(0.0, 75.0), parts="pid",
    ...     particles=12, iterations=8,
    ... )
    >>> len(found.tuned), found.errors.shape
    (2, (2, 1, 2))
    """
    make = waveform or _sines(centre)
    nothing = Pid(kp=1.0, ti=1.0)
    # The grid is checked before anything is searched.
    grid = ScheduledPid(
        amplitudes=amplitudes, rates=rates, gains=[nothing] * (_count(amplitudes) * _count(rates))
    )
    parts = options.pop("parts", ("pid", "low-pass"))
    if "repetitive" in parts:
        raise ParameterError("parts has 'repetitive': expected none, its period is of one rate")
    pairs = [(amplitude, rate) for amplitude in grid.amplitudes for rate in grid.rates]
    references = [make(amplitude, rate) for amplitude, rate in pairs]
    common = {"margins": margins, "spread": spread, **options}
    fixed = tune(stage, references, parts=parts, **common)
    common |= {"dt": fixed.controller.dt, "limits": fixed.controller.limits}
    common["filters"] = fixed.controller.filters
    tuned, errors = [], []
    for reference, whole in zip(references, fixed.report.runs, strict=True):
        one = tune(stage, reference, parts="pid", **common)
        before, after = (run.metrics.rms_error for run in (whole, one.report.runs[0]))
        # A search for one reference alone may miss what the search for all has found.
        tuned.append(one if after < before else fixed)
        errors.append((before, min(before, after)))
    gains = [one.controller.feedback for one in tuned]
    law = replace(grid, gains=[one for one in gains if isinstance(one, Pid)])
    controller = replace(fixed.controller, feedback=law)
    stages = list(stage) if isinstance(stage, Sequence) else [stage]
    plants = plants_of(stages, controller.limits, options.get("delay", 0.0), spread or Spread())
    _check_between(controller, law, [one.plant for one in plants], margins or Margins())
    table = np.array(errors).reshape(len(grid.amplitudes), len(grid.rates), 2)
    return Schedule(controller, fixed, tuple(tuned), table)


def _count(values: object) -> int:
    """Return how many there are; of what is no sequence none, which the grid refuses."""
    return len(values) if isinstance(values, Sized) else 0


def _sines(centre: float) -> Waveform:
    def make(amplitude: float, rate: float) -> Reference:
        low, high = centre - amplitude, centre + amplitude
        return sine(frequency=rate, low=low, high=high, duration=PERIODS / rate)

    return make


def _check_between(
    controller: Controller, law: ScheduledPid, plants: list[_core.LoopPlant], margins: Margins
) -> None:
    """Refuse gains that lose their margins half-way between two places of the grid."""
    columns = len(law.rates)
    weights = np.array([_weights(one) for one in law.gains]).reshape(-1, columns, 3)
    middles = [
        *(0.5 * (weights[1:] + weights[:-1])).reshape(-1, 3),
        *(0.5 * (weights[:, 1:] + weights[:, :-1])).reshape(-1, 3),
    ]
    for kp, integral, derivative in middles:
        pid = Pid(kp=kp, ti=kp / integral, td=derivative / kp, tt=controller.dt)
        between = replace(controller, feedback=pid)
        for plant in plants:
            check = _core.check_loop(between._core, plant)
            if not check["stable"] or check["sensitivity"] > margins.sensitivity * (1.0 + SLACK):
                raise ParameterError(
                    "amplitudes and rates: gains half-way between two places of the grid have a "
                    f"sensitivity of {check['sensitivity']:.3g}: expected at most "
                    f"{margins.sensitivity:.3g}; take a finer grid or a smaller margin"
                )


def _weights(one: Pid) -> tuple[float, float, float]:
    """Proportional gain, integral gain [V/(m s)] and derivative gain [V s/m]."""
    return one.kp, one.kp / one.ti, one.kp * one.td
