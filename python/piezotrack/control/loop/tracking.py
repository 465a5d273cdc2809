"""Tracking: closed-loop simulation of a stage along a reference, and its metrics."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ... import _core
from ..._support.arguments import not_negative, positive
from ..._support.arrays import signal_of
from ..._support.display.frames import frame_of
from ..._support.display.result import Panel, Result
from ..._support.files.writing import write_result
from ..._support.statistics import FIGURES, ErrorStatistics
from ..._support.units import drive_word, shown_unit
from ...errors import DataError, ParameterError
from ...stages.inverse import PlayedVoltage
from .settling import Settling, settled_moves

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from ...references.reference import Reference, SampledReference
    from ..controller.controller import Controller

    Array = NDArray[np.float64]

__all__ = ["Metrics", "Tracking"]

# Periods after which what learns has learnt.
LEARNT = 3
# Samples of a spectrum, at least.
FEWEST = 16


@dataclass(frozen=True, kw_only=True, repr=False)
class Metrics(ErrorStatistics):
    """Metrics of a tracked motion; errors are desired less actual.

    Attributes
    ----------
    phase_lag : float or None
        Phase lag of the fundamental [rad]; None where the reference does not repeat.
    widest_loop : float or None
        Widest loop of actual against desired, as a part of the travel; None where the reference
        never reverses.
    """

    phase_lag: float | None
    widest_loop: float | None

    def _rows(self) -> list[tuple[str, str]]:
        rows = super()._rows()
        if self.phase_lag is not None:
            rows.append(("phase lag", f"{math.degrees(self.phase_lag):.3g}\N{DEGREE SIGN}"))
        if self.widest_loop is not None:
            rows.append(("residual hysteresis", f"{100.0 * self.widest_loop:.3g} % of travel"))
        return rows

    def __str__(self) -> str:
        text = super().__str__()
        if self.phase_lag is not None:
            text += f", phase lag {math.degrees(self.phase_lag):.3g} deg"
        if self.widest_loop is not None:
            text += f", residual hysteresis {100.0 * self.widest_loop:.2f} % of travel"
        return text


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Tracking(Result):
    """A tracked motion; printed, a table of its metrics.

    Its picture shows motion, error, actual against desired, and the voltage with its parts; each
    alone, in axes of your own, is a method, as `plot_error`.

    Attributes
    ----------
    reference : Reference
        The reference.
    controller : Controller
        The controller.
    t : ndarray, shape (n,)
        Time of the control samples [s].
    desired, measured, displacement : ndarray, shape (n,)
        Reference, sensor reading and true displacement [m]; the voltage of a sample is computed
        from the reading of the same sample.
    loop_error : ndarray, shape (n,)
        Last error computed by the controller [m], from its filtered reading. For an axis that is
        sampled after the other it belongs to the point of the path of that sample, and is 0
        before the first.
    voltage : ndarray, shape (n,)
        Command to the amplifier [V].
    feedforward, feedback, repetitive : ndarray, shape (n,)
        Its parts before it was clipped [V].
    saturated : ndarray of bool, shape (n,)
        Whether the command was clipped.
    fine_t, fine_displacement, fine_voltage : ndarray, shape (m,)
        Time [s], true displacement [m] and applied voltage [V] between the samples too.
    note : str
        Description of the feedforward.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "control.views.tracking_text:tracking_text",
        "plot": "control.views.tracking_plot:plot_tracking",
        "plot_motion": "control.views.tracking_plot:plot_motion",
        "plot_error": "control.views.tracking_plot:plot_error",
        "plot_following": "control.views.tracking_plot:plot_following",
        "plot_effort": "control.views.tracking_plot:plot_effort",
    }

    reference: Reference
    controller: Controller
    t: Array
    desired: Array
    measured: Array
    displacement: Array
    loop_error: Array
    voltage: Array
    feedforward: Array
    feedback: Array
    repetitive: Array
    saturated: NDArray[np.bool_]
    fine_t: Array
    fine_displacement: Array
    fine_voltage: Array
    note: str

    def __repr__(self) -> str:
        return f"<Tracking of {self.reference!r}: {self.metrics}>"

    @property
    def error(self) -> Array:
        """Desired less measured [m]."""
        return self.desired - self.measured

    @property
    def settled(self) -> float:
        """Time from which `metrics` are computed [s].

        After the smooth start; of a reference that repeats, from the first whole period after it
        if there is one. 0 where the smooth start lasts to the end.
        """
        first = settled_from(self.reference, float(self.t[-1]))
        # A run that was ended before counts as a whole.
        return first if first < self.t[-1] - 1e-9 else 0.0

    @cached_property
    def metrics(self) -> Metrics:
        """Metrics of the measured motion, from `settled` on."""
        return self.score()

    def score(
        self, start: float | None = None, stop: float | None = None, *, true: bool = False
    ) -> Metrics:
        """Metrics of a part of the run.

        Parameters
        ----------
        start, stop : float, optional
            The part [s]; default from `settled` to the end.
        true : bool, optional
            Whether to use the true displacement, without noise and quantisation of the sensor.

        Returns
        -------
        Metrics
            Of that part.
        """
        part = self.part(self.t, start, stop)
        actual = self.displacement if _core.as_truth("true", true) else self.measured
        # A device may have no reading at a sample.
        read = part & np.isfinite(actual)
        whole = bool(read.sum() == part.sum())
        part = read if read.sum() >= 2 else part
        dt, period = self.controller.dt, self.reference.period
        # A phase needs a whole period, and more than two samples of it.
        frequency = None if period is None else 1.0 / period
        if frequency and not (
            whole and part.sum() * dt * frequency >= 0.999 and frequency * dt < 0.5
        ):
            frequency = None
        return _metrics(_core.tracking_metrics(self.desired[part], actual[part], dt, frequency))

    def part(self, t: Array, start: float | None, stop: float | None) -> NDArray[np.bool_]:
        """Return which instants lie in a part of the run.

        Parameters
        ----------
        t : ndarray, shape (n,)
            Instants [s].
        start, stop : float or None
            As in `score`.

        Returns
        -------
        ndarray of bool, shape (n,)
            True for two instants at least.

        Raises
        ------
        ParameterError
            There are fewer.
        """
        first = self.settled if start is None else not_negative("start", start, "s")
        last = math.inf if stop is None else _core.as_number("stop", stop)
        t = signal_of("t", t)
        part: NDArray[np.bool_] = (t >= first - 1e-9) & (t < last - 1e-9)
        if part.sum() < 2:
            raise ParameterError(
                "start and stop",
                f"{first:g} and {last:g} s",
                f"a part of the run, 0 to {self.t[-1]:g} s, with two samples",
                verb="are",
            )
        return part

    def error_spectrum(self) -> tuple[Array, Array]:
        """Return the amplitude density of the measured error, from `settled` on.

        By Welch's method (1967, doi 10.1109/TAU.1967.1161901) with Hann windows of a quarter of the
        run, half overlapped.

        Returns
        -------
        frequency, density : ndarray, shape (k,)
            Frequencies above 0 [Hz], and the root of the power density [m/sqrt(Hz)].

        Raises
        ------
        DataError
            There are fewer than 16 samples after `settled`, or a reading is missing.

        Examples
        --------
        >>> import piezotrack as pt
        >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
        >>> run = pt.track(pt.VirtualStage.xu_li_2010(seed=1), loop, "sine:0.2Hz,0..100um,20s")
        >>> frequency, density = run.error_spectrum()
        >>> round(float(frequency[-1]))
        25
        """
        from scipy.signal import welch

        error = self.error[self.t >= self.settled]
        if error.size < FEWEST or not np.isfinite(error).all():
            raise DataError(
                f"the run has {error.size} samples after {self.settled:g} s: expected {FEWEST} "
                "readings or more without a gap"
            )
        frequency, power = welch(error, 1.0 / self.controller.dt, nperseg=max(8, error.size // 4))
        return frequency[1:], np.sqrt(power[1:])

    def settling(self, band: float = 0.02) -> list[Settling]:
        """Return when each move from one level of the reference to the next has settled.

        Parameters
        ----------
        band : float, optional
            Distance from the level, as a share of the move, within which it has settled.

        Returns
        -------
        list of Settling
            One for each level that is held for four samples or more and a fifth of the longest
            hold, of the true displacement; empty where the reference holds none.

        Raises
        ------
        ParameterError
            `band` is not above 0.

        Examples
        --------
        >>> import piezotrack as pt
        >>> stage = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=[10.0], weights=[0.2e-6])
        >>> loop = pt.Controller(dt=1e-3, limits=(0.0, 75.0), feedforward=stage.inverse())
        >>> moves = pt.track(stage, loop, "staircase:levels=0/20um,dwell=100ms").settling()
        >>> [round(1e3 * move.time) for move in moves]
        [19]
        """
        return settled_moves(
            self.t, self.desired, self.displacement, positive("band", band, "share of a move")
        )

    @cached_property
    def periods(self) -> list[Metrics]:
        """Metrics of each whole period, the first including the smooth start.

        Empty where the reference does not repeat, ends within its first period, or has fewer
        than four samples in one.
        """
        dt, period = self.controller.dt, self.reference.period
        if period is None or not 4.0 <= period / dt <= self.t.size + 0.01:
            return []
        found = _core.period_metrics(self.desired, self.measured, dt, period)
        return [_metrics(figures) for figures in found]

    @property
    def table(self) -> dict[str, Array]:
        """Columns of the run at the control samples, with their units in the names."""
        unit, scale = shown_unit(self.controller.drive_unit)
        command = drive_word(self.controller.drive_unit)
        return {
            "time_s": self.t,
            "desired_um": 1e6 * self.desired,
            "measured_um": 1e6 * self.measured,
            f"{command}_{unit}": scale * self.voltage,
            f"feedforward_{unit}": scale * self.feedforward,
            f"feedback_{unit}": scale * self.feedback,
            f"repetitive_{unit}": scale * self.repetitive,
        }

    def to_frame(self) -> Any:
        """Return the run as a data frame of pandas.

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
            Of numbers, texts, lists and dicts only.
        """
        loop = self.controller
        law, learner = loop.feedback, loop.repetitive
        return {
            "format": "piezotrack-tracking",
            "schema_version": 1,
            "reference": repr(self.reference),
            "dt": {"value": loop.dt, "unit": "s"},
            "limits": {
                "value": list(loop.limits),
                "unit": loop.drive_unit,
            },
            "feedback": None if law is None else repr(law),
            "repetitive": None if learner is None else repr(learner),
            "feedforward": self.note,
            "unit": "errors in m, phase lag in rad, widest loop as a part of the travel",
            "from_s": self.settled,
            "metrics": asdict(self.metrics),
            "true_metrics": asdict(self.score(true=True)),
            "periods": [asdict(period) for period in self.periods],
            "settling": [_entry(move) for move in self.settling()],
            "model_drive_range": None,
            "notes": [],
            "provenance": {"package": "piezotrack", "version": _core.__version__},
        }

    def save(
        self, folder: str | os.PathLike[str], *, entries: Mapping[str, Any] | None = None
    ) -> list[Path]:
        """Write samples, metrics and picture to a folder, in one go.

        Parameters
        ----------
        folder : path-like
            It is made where it does not exist.
        entries : mapping, optional
            More entries of the JSON file, which replace those of `document`.

        Returns
        -------
        list of pathlib.Path
            ``tracking.csv``, ``tracking.json``, ``tracking.png`` and ``.svg``.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        document = self.document() | dict(entries or {})
        return write_result(folder, "tracking", document, self.plot(), self.table)

    plot_motion = Panel("Plot desired and measured displacement over time.")
    plot_error = Panel("Plot the tracking error over time, with its first instants in an inset.")
    plot_following = Panel("Plot measured against desired displacement, after settling.")
    plot_effort = Panel("Plot the voltage and its parts over time.")


def _metrics(
    figures: tuple[float, float, float, float, float, float | None, float | None],
) -> Metrics:
    *errors, lag, loop = figures
    return Metrics(**dict(zip(FIGURES, errors, strict=True)), phase_lag=lag, widest_loop=loop)


def _entry(move: Settling) -> dict[str, float | None]:
    """Return a move for the JSON file, the unit in the name."""
    times = {f"{name}_s": getattr(move, name) for name in ("start", "travel", "time")}
    finite = {name: value if math.isfinite(value) else None for name, value in times.items()}
    return {**finite, "low_m": move.low, "high_m": move.high, "overshoot": move.overshoot}


def settled_from(reference: Reference, end: float) -> float:
    """Time from which a run along a reference counts as settled [s]; it ends at `end`."""
    period = reference.period
    if period is None:
        return reference.ramp if reference.ramp < end - 1e-9 else 0.0
    start = math.ceil(reference.ramp / period - 1e-9) * period
    return start if start + period <= reference.duration * (1 + 1e-9) else 0.0


def can_be_learnt(reference: Reference) -> bool:
    """Whether a reference repeats so often that something can learn it, and one period counts."""
    period = reference.period
    return period is not None and reference.duration > (LEARNT + 1) * period


def first_counted(reference: Reference, samples: SampledReference, *, learns: bool) -> int:
    """Return the first sample that counts: settled and, where something learns, learnt."""
    end, dt = float(samples.t[-1]), samples.dt
    start = settled_from(reference, end)
    if learns and reference.period is not None:
        learnt = start + LEARNT * reference.period
        start = learnt if learnt + reference.period <= end + dt else start
    return math.ceil(start / dt - 1e-9)


def feedforward_of(
    controller: Controller, reference: Reference, samples: SampledReference
) -> PlayedVoltage:
    """Compute the feedforward of a whole run [V], and a note of how."""
    if controller.feedforward is None:
        return PlayedVoltage(np.zeros(len(samples)), "no feedforward")
    return controller.feedforward.played(
        reference, controller.dt, samples=samples, limits=controller.limits
    )
