"""Gains over amplitude and rate of the reference."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence, Sized
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Unpack

import numpy as np

from ... import _core
from ..._support.display.frames import frame_of
from ..._support.display.result import Result
from ..._support.files.writing import write_result
from ..._support.messages import quoted
from ...errors import ParameterError
from ...references.paths import circle
from ...references.reference import Reference
from ...references.waveforms import sine
from ...references.xy_reference import XYReference
from ...stages.xy import XYStage
from ..laws.pid import Pid
from ..laws.scheduled_pid import ScheduledPid
from ..loop.contouring import contour
from ..running.track import track
from ..timing import Timing
from .margins import Margins, Spread, plants_of
from .tune import tune

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from numpy.typing import NDArray

    from ...identification.fitted.identified_model import IdentifiedModel
    from ..controller.controller import Controller
    from ..plant import Plant
    from .tune import TuneOptions
    from .tuned import Tuned

    Array = NDArray[np.float64]

__all__ = ["Schedule", "schedule"]

# Periods along which a reference of the grid is followed: the first is its smooth start.
PERIODS = 4
# Excess of a margin that an interpolated set of gains may have.
SLACK = 0.05
# Share by which gains of a place are better than the fixed ones, or the fixed ones are taken.
LEAST_GAIN = 0.03
# Where a place of the schedule is worse than with the fixed ones by more, its neighbour gets those.
SPOILT = 1.001
Waveform = Callable[[float, float], Reference]
PathForm = Callable[[float, float], XYReference]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Schedule(Result):
    """Scheduled gains beside one fixed set for all references.

    Its picture is the errors with both.

    Attributes
    ----------
    controllers : tuple of Controller
        With scheduled gains: one, of an XY stage those of x and y.
    fixed : Tuned
        One set of gains for all references of the grid.
    tuned : tuple of Tuned
        For each amplitude, or radius, the gains at each rate.
    errors : ndarray, shape (amplitudes, rates, 2)
        Rms error, or contour error, with the fixed and with the scheduled gains [m].
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "control.views.tuning:schedule_text",
        "plot": "control.views.tuning:plot_schedule",
    }

    controllers: tuple[Controller, ...]
    fixed: Tuned
    tuned: tuple[Tuned, ...]
    errors: Array

    @property
    def controller(self) -> Controller:
        """The controller; of an XY stage that of x."""
        return self.controllers[0]

    @property
    def amplitudes(self) -> tuple[float, ...]:
        """Amplitudes, or radii, of the grid [m]."""
        law: Any = self.controller.feedback
        return tuple(law.amplitudes)

    @property
    def rates(self) -> tuple[float, ...]:
        """Rates of the grid [Hz]."""
        law: Any = self.controller.feedback
        return tuple(law.rates)

    def __repr__(self) -> str:
        return f"<Schedule: {len(self.amplitudes)} amplitudes, {len(self.rates)} rates>"

    @property
    def table(self) -> dict[str, Array]:
        """Columns with errors and gains at each place of the grid, units in the names.

        Those of an XY stage begin with ``x_`` and ``y_``.
        """
        errors = self.errors.reshape(-1, 2)
        columns = {
            "amplitude_m": np.repeat(self.amplitudes, len(self.rates)),
            "rate_Hz": np.tile(self.rates, len(self.amplitudes)),
            "fixed_rms_m": errors[:, 0],
            "scheduled_rms_m": errors[:, 1],
        }
        prefixes = ("",) if len(self.controllers) == 1 else ("x_", "y_")
        for prefix, controller in zip(prefixes, self.controllers, strict=True):
            law: Any = controller.feedback
            for name, unit in (("kp", f"{controller.drive_unit}_per_m"), ("ti", "s"), ("td", "s")):
                gains = [getattr(gains, name) for gains in law.gains]
                columns[f"{prefix}{name}_{unit}"] = np.array(gains)
        return columns

    def to_frame(self) -> Any:
        """Return the grid as a data frame of pandas.

        Returns
        -------
        pandas.DataFrame
            With the columns of `table`.

        Raises
        ------
        ParameterError
            pandas is not installed.
        """
        return frame_of(self.table)

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only: the columns of `table`.
        """
        return {
            "format": "piezotrack-schedule",
            "schema_version": 1,
            "columns": {name: values.tolist() for name, values in self.table.items()},
            "provenance": {"package": "piezotrack", "version": _core.__version__},
        }

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the grid and the picture to a folder, in one go.

        Parameters
        ----------
        folder : path-like
            It is made where it does not exist.

        Returns
        -------
        list of pathlib.Path
            ``schedule.csv``, ``schedule.json``, ``schedule.png`` and ``.svg``.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        return write_result(folder, "schedule", self.document(), self.plot(), self.table)


def schedule(
    stage: Plant | IdentifiedModel | Sequence[Plant | IdentifiedModel] | XYStage,
    amplitudes: Sequence[float],
    rates: Sequence[float],
    *,
    centre: float | tuple[float, float] | None = None,
    waveform: Waveform | PathForm | None = None,
    **options: Unpack[TuneOptions],
) -> Schedule:
    """Tune PID gains at each amplitude and rate of a grid, for one controller without bumps.

    First one set of gains and filters is tuned for all references of the grid. Then, with those
    filters, the gains for each reference. Where the scheduled gains are not better for it than the
    fixed set by 3 %, that is taken. The margins hold at every place of the grid and half-way
    between neighbours, for every plant of the set.

    Parameters
    ----------
    stage : Stage, VirtualStage, IdentifiedModel, or a sequence of them; or XYStage
        As of `tune`: of an XY stage the contour error counts, and each axis has gains of its own.
    amplitudes : sequence of float
        Half of peak to peak, or radii [m], rising, 1 to 4.
    rates : sequence of float
        Frequencies [Hz], rising, 1 to 4.
    centre : float or (float, float), optional
        Middle of the references [m]; of an XY stage the centre of the circles, by default as of
        `circle`.
    waveform : callable, optional
        Makes the reference of an amplitude [m] and a rate [Hz]; default a sine of four periods
        about `centre`, of an XY stage a circle of three turns.
    **options
        Arguments of `tune`; `parts` is PID and low-pass by default, without a repetitive part.

    Returns
    -------
    Schedule
        The controller, of an XY stage both, the fixed set, and the errors with both.

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
    ...     search=pt.TuningSearch(particles=12, iterations=8),
    ... )
    >>> len(found.tuned), found.errors.shape
    (2, (2, 1, 2))
    """
    both = isinstance(stage, XYStage)
    make: Any = _waveform(both, centre) if waveform is None else waveform
    if not callable(make):
        raise ParameterError("waveform", quoted(waveform), "a function")
    nothing = Pid(kp=1.0, ti=1.0)
    # The grid is checked before anything is searched.
    grid = ScheduledPid(
        amplitudes=amplitudes, rates=rates, gains=[nothing] * (_count(amplitudes) * _count(rates))
    )
    parts = options.pop("parts", ("pid", "low-pass"))
    if "repetitive" in (parts or ()):
        raise ParameterError("parts", "'repetitive'", "none, its period is of one rate", verb="has")
    pairs = [(amplitude, rate) for amplitude in grid.amplitudes for rate in grid.rates]
    references = [make(amplitude, rate) for amplitude, rate in pairs]
    common: dict[str, Any] = {**options}
    search: Any = tune
    fixed = search(stage, references, parts=parts, **common)
    loops = fixed.controllers
    common |= {"dt": loops[0].dt, "limits": loops[0].limits}
    common["filters"] = tuple(one.filters for one in loops) if both else loops[0].filters
    timing = options.get("timing") or Timing()
    tuned = [search(stage, reference, parts="pid", **common) for reference in references]
    motions = list(zip(pairs, references, strict=True))
    chosen, scheduled, errors = _chosen(stage, motions, tuned, fixed, grid, timing)
    sets: list[Sequence[Any]]
    if isinstance(stage, XYStage):
        sets = [[stage.x], [stage.y]]
    else:
        sets = [stage if isinstance(stage, Sequence) else [stage]]
    spread, margins = options.get("spread") or Spread(), options.get("margins") or Margins()
    for controller, stages in zip(scheduled, sets, strict=True):
        plants = plants_of(stages, controller.limits, timing.delay, spread)
        _check_between(controller, [one.plant for one in plants], margins)
    table = errors.reshape(len(grid.amplitudes), len(grid.rates), 2)
    return Schedule(controllers=tuple(scheduled), fixed=fixed, tuned=tuple(chosen), errors=table)


def _chosen(
    stage: Any,
    motions: Sequence[tuple[tuple[float, float], Any]],
    tuned: Sequence[Any],
    fixed: Tuned,
    grid: ScheduledPid,
    timing: Timing,
) -> tuple[list[Any], list[Controller], Array]:
    """Take the gains of a place where they are better in the schedule, else the fixed ones."""
    before = [one.metrics.rms_error for one in fixed.runs]
    chosen = list(tuned)
    while True:
        loops = enumerate(fixed.controllers)
        scheduled = [_scheduled(grid, loop, chosen, axis) for axis, loop in loops]
        after = [_error(stage, scheduled, place, one, timing) for place, one in motions]
        # A search for one reference alone may miss what that for all has found; and in the schedule
        # its gains begin with those of the places around it.
        better = [new < (1.0 - LEAST_GAIN) * old for new, old in zip(after, before, strict=True)]
        own = [i for i, one in enumerate(chosen) if one is not fixed]
        if all(better[i] for i in own):
            ratios = np.array(after) / np.array(before)
            if not own or ratios.max() <= SPOILT:
                return chosen, scheduled, np.column_stack([before, after])
            # The gains of a place act on the way to others: those nearest to the worst go.
            better[_nearest(int(ratios.argmax()), own, len(grid.rates))] = False
        chosen = [one if gains else fixed for gains, one in zip(better, chosen, strict=True)]


def _nearest(place: int, others: Sequence[int], columns: int) -> int:
    """Return which of some places of the grid is nearest to a place."""

    def distance(other: int) -> int:
        (row, column), (its, at) = divmod(place, columns), divmod(other, columns)
        return abs(row - its) + abs(column - at)

    return min(others, key=distance)


def _scheduled(grid: ScheduledPid, loop: Controller, tuned: Sequence[Any], axis: int) -> Controller:
    gains: list[Any] = [one.controllers[axis].feedback for one in tuned]
    return replace(loop, feedback=replace(grid, gains=gains))


def _error(
    stage: Any,
    controllers: Sequence[Controller],
    place: tuple[float, float],
    reference: Any,
    timing: Timing,
) -> float:
    """Rms error [m] along a reference, beginning with the gains of its place."""
    laws: list[Any] = [one.feedback for one in controllers]
    loops = [
        replace(controller, feedback=replace(law, first=place))
        for controller, law in zip(controllers, laws, strict=True)
    ]
    how: dict[str, Any] = {"timing": timing, "beyond_reach": True, "unstable": True}
    if isinstance(stage, XYStage):
        return contour(stage, loops, reference, **how).metrics.rms_error
    first = stage[0] if isinstance(stage, Sequence) else stage
    return track(first, loops[0], reference, **how).metrics.rms_error


def _waveform(both: bool, centre: Any) -> Any:
    if both:
        middle = {} if centre is None else {"centre": centre}
        return lambda radius, rate: circle(frequency=rate, radius=radius, **middle)
    if centre is None:
        raise ParameterError("centre", "missing", "the middle of the references in m")
    return _sines(centre)


def _count(values: object) -> int:
    """Return how many there are; of what is no sequence none, which the grid refuses."""
    return len(values) if isinstance(values, Sized) else 0


def _sines(centre: float) -> Waveform:
    def make(amplitude: float, rate: float) -> Reference:
        low, high = centre - amplitude, centre + amplitude
        return sine(frequency=rate, low=low, high=high, duration=PERIODS / rate)

    return make


def _check_between(controller: Controller, plants: list[_core.LoopPlant], margins: Margins) -> None:
    """Refuse gains that lose their margins half-way between two places of the grid."""
    law: Any = controller.feedback
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
                    f"{margins.sensitivity:.3g}; take a finer grid or a smaller margin",
                    argument="amplitudes",
                )


def _weights(gains: Pid) -> tuple[float, float, float]:
    """Proportional gain, integral gain [V/(m s)] and derivative gain [V s/m]."""
    return gains.kp, gains.kp / gains.ti, gains.kp * gains.td
