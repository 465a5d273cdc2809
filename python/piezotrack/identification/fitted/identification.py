"""The result of an identification: model, record, cost and settings."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ... import _core
from ..._support.display.result import Panel
from ..._support.statistics import sample_noise
from ...data.checks import diagnostics
from ...data.checks.connections import unusual_connection
from ...data.checks.drive_features import drive_features
from ...data.checks.hum import hum_lines, hum_notes, power_of
from ...data.checks.record_flags import record_warnings
from ..methods.descents import Descents
from ..methods.particle_swarm import ParticleSwarm
from .fitted_record import FittedRecord
from .identified_model import IdentifiedModel
from .notes import (
    above_noise,
    amplitude_notes,
    deviation_of,
    drift_notes,
    first_samples,
    fit_percent,
    lag_notes,
)

if TYPE_CHECKING:
    import datetime
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from ..._support.display.look import Style, Width
    from ..._support.display.result import Result
    from ...data.dataset import Dataset
    from ...stages.motion import Response
    from ..methods.least_squares import LeastSquares
    from .estimates import Constraint, Estimate, LagRange, SearchRun, StopReason
    from .score import Score
    from .selection import Selection

    Array = NDArray[np.float64]

__all__ = ["Identification"]

# Ratio of the rates of two records from which on a lag that fits both holds at more than one rate.
OTHER = 1.5


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Identification(IdentifiedModel):
    """Result of an identification; see `IdentifiedModel` for its use.

    Attributes
    ----------
    data : Dataset
        The record; the first of several.
    records : tuple of FittedRecord
        The records, each with its weight, delay, offset, start and cost. `data`, `delay`,
        `offset`, `start` and `fitted` are those of the first, and `stroke` is the largest.
    cost : float
        RMS deviation in the window [m], equation (16) of Xu and Li 2010; of several records see
        `identify`.
    nfev : int
        Simulations of the record, of all runs.
    stop_reason : {"agreed", "converged", "stalled", "iterations", "interrupted", "solved"}
        Why the fit ended; ``"solved"`` after least squares.
    method : Descents or ParticleSwarm or LeastSquares
        Method that found it, with its settings.
    parameters : dict of str to Estimate
        The parameters with units, bounds and standard deviations; and the delay where it
        was fitted. Empty after least squares.
    constraints : tuple of Constraint
        The inequalities that were given, each with whether it decides the result.
    search : SearchRun or None
        Course of the search; None after least squares.
    lags : LagRange or None
        Lags that fit as well, where the drive is too slow to tell them from hysteresis and creep.
    selection : Selection or None
        The choice between models; None without ``model="auto"``.
    at_bound : bool
        Whether least squares left a time constant or a frequency on a bound of its range.
    """

    views: ClassVar[Mapping[str, str]] = {
        **IdentifiedModel.views,
        "summary": "identification.views.report:summary_text",
        "html": "identification.views.html:identification_html",
        "plot_convergence": "identification.views.plot:plot_convergence",
        "residual": "identification.views.confidence.residual_plot:plot_fit_residual",
        "report": "identification.views.report_page.page:write_report",
    }

    data: Dataset
    cost: float
    nfev: int
    stop_reason: StopReason
    method: Descents | ParticleSwarm | LeastSquares
    parameters: Mapping[str, Estimate] = field(default_factory=dict)
    constraints: tuple[Constraint, ...] = ()
    search: SearchRun | None = None
    lags: LagRange | None = None
    selection: Selection | None = None
    at_bound: bool = False

    def __post_init__(self) -> None:
        if not self.records:
            # One record, whose own are those of the result.
            record = FittedRecord(
                data=self.data,
                delay=self.delay,
                offset=self.offset,
                offset_fitted=self.offset_fitted,
                drift=self.drift,
                start=self.start,
                cost=self.cost,
                stroke=self.stroke,
                origin=self._record,
            )
            object.__setattr__(self, "records", (record,))

    def __repr__(self) -> str:
        return (
            f"<Identification, {self.model.info.title}: {self.cost_um:.4g} um rms, "
            f"{self.cost_percent:.3g} % of stroke; see summary()>"
        )

    @property
    def fun(self) -> float:
        """The cost [m], under SciPy's name."""
        return self.cost

    @property
    def cost_um(self) -> float:
        """The cost [um]."""
        return 1e6 * self.cost

    @property
    def cost_percent(self) -> float:
        """The cost in per cent of the stroke."""
        return 100.0 * self.cost / self.stroke

    @property
    def fit_percent(self) -> float:
        """Share of the motion that the model explains, as `Score.fit_percent`."""
        spread = deviation_of([(data, one.weight) for data, one in self._fitted])
        return fit_percent(self.cost, spread)

    @property
    def fitted(self) -> Score:
        """Score on the record that was identified, simulated with converged sub-steps."""
        return self.scores[0]

    @cached_property
    def scores(self) -> tuple[Score, ...]:
        """Score on each record that was identified, with its own offset, delay and start."""
        return tuple(self.score(data, offset=one.offset) for data, one in self._fitted)

    @property
    def _fitted(self) -> list[tuple[Dataset, FittedRecord]]:
        """The records, those of a result being there."""
        return [(one.data, one) for one in self.records if one.data is not None]

    @cached_property
    def _responses(self) -> list[Response]:
        """Motion of the model on each record."""
        return [self.simulate(data, offset=one.offset) for data, one in self._fitted]

    @cached_property
    def noises(self) -> tuple[float, ...]:
        """Noise of each record from sample to sample [m], as far as the model does not explain it.

        0 for a record of fewer than 16 samples.
        """
        pairs = zip(self._fitted, self._responses, strict=True)
        return tuple(
            min(sample_noise(data.measured.y), sample_noise(data.at_readings(data.y - run.x)))
            for (data, _), run in pairs
        )

    @property
    def autocorrelations(self) -> tuple[float, ...]:
        """Correlation of neighbouring residuals of each record, as `ModelScore.autocorrelation`."""
        return tuple(
            float(_core.residual(data.counted(data.y - run.x), 0)[2])
            for (data, _), run in zip(self._fitted, self._responses, strict=True)
        )

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        document = super().document()
        if len(self.records) == 1:
            document["fit"] = document.get("fit", {}) | {
                "max_error": {"value": self.fitted.max_error, "unit": "m"},
                "max_error_time": {"value": self.fitted.max_error_time, "unit": "s"},
                "noise": {"value": self.noises[0], "unit": "m"},
            }
        return document

    @property
    def notes(self) -> list[str]:
        """Warnings about the record and the fit, one sentence each."""
        info, unit = self.model.info, self.data.drive_unit
        notes: list[str] = []
        several = len(self.records) > 1
        for i, ((data, record), run) in enumerate(zip(self._fitted, self._responses, strict=True)):
            source = f" ({data.source})" if data.source else ""
            which = f"record {i + 1}{source}: " if several else ""
            notes += [which + note for note in self._notes_on(data, record, run)]
        if self.interpolation:
            notes.append(
                "the drive is fast for its sampling rate: it is interpolated to "
                f"{self.interpolation} times the rate, which fits better than straight lines"
            )
        if info.drive_unit == "N" and unit != "N":
            notes.append(f"the drive is in {unit}: forces are in {unit} too, not in N")
        rates = [_frequency(data) for data, _ in self._fitted]
        if self.lags is not None and (self.lags.from_zero or max(rates) < OTHER * min(rates)):
            lag = getattr(self.model, "time_constant", None)
            notes += lag_notes(self.lags, 2.0 * math.pi * rates[0], lag)
        connections = [unusual_connection(data.u, data.y) for data, _ in self._fitted]
        if not info.searched and all(one is None or one.follows for one in connections):
            drives = (drive_features(data.t, data.u, None, unit) for data, _ in self._fitted)
            notes += amplitude_notes(list(drives))
        if self.at_bound:
            notes.append(
                "the record does not determine the dynamics: time constant or mode lies on a bound"
            )
        if self.search and len(self.search.runs) > 1 and self.search.agreeing_runs == 1:
            what = "restart" if isinstance(self.method, ParticleSwarm) else "descent"
            notes.append(f"no other {what} ended in the minimum of the best one: increase runs=")
        return notes

    def _notes_on(self, data: Dataset, record: FittedRecord, run: Response) -> list[str]:
        """Warnings about one of the records and the fit there."""
        notes, rest, measured = record_warnings(data), data.y - run.x, data.measured
        rest = data.at_readings(rest)
        if measured.left_out is not None:
            rest[measured.left_out] = measured.counted(rest).mean()
        if record.cost_percent > 5.0:
            notes.append(
                "the model does not fit this record: the residual is "
                f"{record.cost_percent:.3g} % of stroke"
            )
        connection = unusual_connection(data.u, data.y)
        if record.cost_percent > diagnostics.REMAINS and (connection is None or connection.follows):
            held = [name for name, estimate in self.parameters.items() if not estimate.free]
            notes += diagnostics.fit_warnings(
                data, run.x, record.cost_percent, self.model.info.hysteresis, held
            )
        notes += drift_notes(record.drift, record.stroke)
        jumped = record.start is not None and record.start.history == "rest"
        is_fitted = self.details.get("delay", {}).get("free", False)
        if jumped and is_fitted and 0.0 < record.delay < data.measured_dt:
            notes.append(
                f"the delay of {1e3 * record.delay:.3g} ms may be that of the jump within the "
                "first sampling interval, not of the sensor"
            )
        notes += self.model._notes(lambda: run)
        lines = hum_lines(rest, measured.u, measured.y, measured.dt)
        notes += hum_notes(lines)
        if self.selection:
            # A mode moves from sample to sample as noise does; what is left of it hardly does.
            without_hum = (
                math.sqrt(max(record.cost**2 - power_of(lines), 0.0)) if lines else record.cost
            )
            notes += above_noise(without_hum, min(sample_noise(measured.y), sample_noise(rest)))
        return notes + first_samples(rest, measured)

    @property
    def success(self) -> bool:
        """Whether the fit was not interrupted."""
        return self.stop_reason != "interrupted"

    @property
    def message(self) -> str:
        """Why the fit ended, in words."""
        method = self.method
        if self.stop_reason == "stalled" and isinstance(method, ParticleSwarm):
            return (
                f"{method.stall_iterations} iterations in a row improved the cost by less than "
                f"{1e6 * method.min_improvement:g} um"
            )
        if self.stop_reason == "iterations" and isinstance(method, ParticleSwarm):
            return f"all {method.iterations} iterations were done"
        if self.stop_reason == "agreed":
            return "independent descents agree"
        if self.stop_reason == "iterations" and isinstance(method, Descents):
            return f"all {method.rounds} rounds were done"
        return self.stop_reason

    plot_convergence = Panel("Draw the best cost of a search after each iteration.")

    def plot_residual(
        self,
        *,
        record: int = 0,
        fig: Figure | SubFigure | None = None,
        style: Style | None = None,
        width: Width | None = None,
    ) -> Figure:
        """Draw the residual against time, drive, rate and amplitude, and say what explains it.

        `piezotrack.identification.residual_of` has the numbers.

        Parameters
        ----------
        record : int, optional
            Which of several records, from 0.
        fig : matplotlib.figure.Figure or SubFigure, optional
            Where to draw; a new figure of pyplot where not given.
        style : {"screen", "paper"}, optional
            As in `piezotrack.figure_style`.
        width : str or float, optional
            Width of a new figure, as ``"85mm"``; a number is in metres.

        Returns
        -------
        matplotlib.figure.Figure
            The figure drawn in, with six panels.

        Raises
        ------
        ParameterError
            There is no such record.

        Examples
        --------
        >>> from matplotlib.figure import Figure
        >>> import piezotrack as pt
        >>> log = pt.datasets.dbo_training()[3.0:8.0]
        >>> fit = pt.identify(log, "prandtl-ishlinskii", progress=False)
        >>> len(fit.plot_residual(fig=Figure(layout="constrained")).axes)
        6
        """
        drawn: Figure = self.view("residual")(self, record, fig, style=style, width=width)
        return drawn

    def report(
        self,
        path: str | os.PathLike[str],
        *,
        controller: Result | None = None,
        suggestion: Result | None = None,
        date: datetime.date | None = None,
    ) -> Path:
        """Write a report of the stage for readers who do not know the package.

        The file has gain, loop, errors and noise, the pictures, the parameters with their
        intervals, the verdicts and notes, and what repeats the fit: hashes, versions and the call.

        Parameters
        ----------
        path : path-like
            The file: ``.html``, which loads nothing from elsewhere, or ``.pdf``. A temporary file
            is written and renamed, so that an existing file is replaced only when the new one is
            complete.
        controller : Result, optional
            A controller for the stage and its margins, as `piezotrack.tune` returns it.
        suggestion : Result, optional
            What to measure next, as `piezotrack.suggest_drive` returns it.
        date : datetime.date, optional
            Date below the title; today where not given. All else depends on the fit alone.

        Returns
        -------
        pathlib.Path
            The file written.

        Raises
        ------
        ParameterError
            The file has another ending, or an argument is of another type.
        DataError
            The file cannot be written.

        Examples
        --------
        >>> import os, tempfile
        >>> import piezotrack as pt
        >>> log = pt.datasets.dbo_training()[3.0:8.0]
        >>> fit = pt.identify(log, "prandtl-ishlinskii", progress=False)
        >>> fit.report(os.path.join(tempfile.mkdtemp(), "report.html")).name
        'report.html'
        """
        written: Path = self.view("report")(
            self, path, controller=controller, suggestion=suggestion, date=date
        )
        return written


def _frequency(data: Dataset) -> float:
    """Frequency of a drive: that of a sine [Hz]."""
    size = float(np.std(data.u))
    rate = float(np.sqrt(np.mean(np.diff(data.u) ** 2))) / data.dt
    return rate / size / (2.0 * math.pi) if size else 0.0
