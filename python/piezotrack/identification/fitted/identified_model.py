"""Identified models: a stage with the offset and delay of its sensor, on records and in files."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ... import _core
from ..._support.arguments import expect
from ..._support.arrays import LARGEST, check_dt, signal_of
from ..._support.files.writing import write_document
from ...data.checks.fast_drive import CURVED, is_fast
from ...data.dataset import Dataset
from ...data.resampling import interpolated
from ...errors import ParameterError, ShapeError
from ...stages.delayed_reading import delayed_reading
from ...stages.slow_loop import SlowLoop
from .certainty.entries import covariance_entry
from .drift import drift_entry
from .fitted_record import record_entries, record_of
from .model_entries import (
    FORMAT,
    SCHEMA_VERSION,
    drive_unit_of,
    parameter_entries,
    sensor_number,
)
from .model_views import ModelViews
from .notes import extrapolation_notes
from .score import Score
from .start import begin, checked_history, same_beginning, start_entry

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from ...data.dataset import Hold
    from ...stages.inverse import Inverse
    from ...stages.motion import Response, StageState
    from .certainty.covariance import Covariance
    from .drift import Drift
    from .fitted_record import FittedRecord
    from .start import History, Start

    Array = NDArray[np.float64]

__all__ = ["IdentifiedModel"]

# A residual of so many times that of the fit is not explained by a simple history.
EXPLAINED = 2.0


@dataclass(frozen=True, kw_only=True)
class IdentifiedModel(ModelViews):
    """An identified stage, with the offset and delay of its sensor.

    Attributes
    ----------
    model : Stage
        The stage.
    offset : float
        Reading of the sensor at rest without drive [m].
    offset_fitted : bool
        Whether the offset was fitted; another record then gets an offset of its own.
    stroke : float
        Stroke of the record identified [m]; percentages refer to it.
    scale_assumed : bool
        Whether the stiffness is nominal: then only ratios of the parameters with the dimension of
        force are known.
    delay : float
        Delay of the displacement, in the amplifier or the reading of the sensor [s].
    start : Start or None
        Where the record identified begins: what the stage went through before, and its state at
        the first sample. None in files of older versions.
    drift : Drift or None
        Drift of the sensor along the record identified, which is in the displacement on that record
        alone.
    records : tuple of FittedRecord
        What each of several records identified has of its own; `offset`, `delay` and `start` are
        those of the first, and `stroke` is the largest. Of one record: a result has it alone, a
        model from a file has none.
    interpolation : int or None
        Samples to which each of a record whose drive is fast for its sampling rate is interpolated,
        as in the fit: band-limited. None where the drive goes straight from sample to sample.
    covariance : Covariance or None
        How sure the values are; None where the record is too short for it, and in files of older
        versions.
    details : mapping
        Other entries of the model file: fit, provenance.
    """

    # A stage of any model: each has its own parameters.
    model: Any
    offset: float
    offset_fitted: bool
    stroke: float
    scale_assumed: bool = False
    delay: float = 0.0
    start: Start | None = None
    drift: Drift | None = None
    records: tuple[FittedRecord, ...] = ()
    interpolation: int | None = None
    covariance: Covariance | None = field(default=None, repr=False, compare=False)
    details: Mapping[str, Any] = field(default_factory=dict, repr=False)

    def __repr__(self) -> str:
        return f"<IdentifiedModel, stroke {1e6 * self.stroke:.4g} um: {self.model!r}>"

    @property
    def drive_range(self) -> tuple[float, float] | None:
        """Lowest and highest drive of the records identified; None if the file has none."""
        ranges = [one["drive_range"] for one in self._origins if one.get("drive_range")]
        if not ranges:
            return None
        return float(min(low for low, _ in ranges)), float(max(high for _, high in ranges))

    @property
    def drive_unit(self) -> str:
        """Unit of the drive, SI: ``"V"``, ``"N"``, or ``"m"`` where the drive is a position."""
        return drive_unit_of(self.details, self.model.info)

    @property
    def zero(self) -> float:
        """Reading of the record identified that `zeroed` subtracted [m]; 0 where nothing was."""
        return float((self.details.get("zero") or {}).get("value", 0.0))

    def zeroed(self) -> IdentifiedModel:
        """Return the model with displacements that count from the beginning of its record.

        A reference, a feedforward and a virtual stage of a model are in the displacements that its
        record has, as from -120 to -74 um. Those of this one begin at 0, as those of
        ``log.zeroed()``: its offset is less by the reading at the first sample of the record, drift
        aside, or at rest without drive where the file has no start.

        Returns
        -------
        IdentifiedModel
            Of the same stage; `zero` is what was subtracted.

        Examples
        --------
        >>> import numpy as np
        >>> import piezotrack as pt
        >>> u = 30.0 - 30.0 * np.cos(np.arange(3000) / 100.0)
        >>> log = pt.Dataset(u=u, y=1e-6 * u - 120e-6, dt=0.005)
        >>> fit = pt.identify(log, "prandtl-ishlinskii")
        >>> print(f"{1e6 * fit.offset:.0f} um, {abs(1e6 * fit.zeroed().offset):.0f} um")
        -120 um, 0 um
        """
        begun = 0.0 if self.start is None else float(self.start.state.x)
        zero = self.offset + begun
        kept = {one.name: getattr(self, one.name) for one in fields(IdentifiedModel)}
        subtracted = {"zero": {"value": self.zero + zero, "unit": "m"}}
        kept |= {"offset": -begun, "records": (), "details": {**self.details, **subtracted}}
        return IdentifiedModel(**kept)

    @property
    def dt(self) -> float | None:
        """Sampling interval of the record identified [s]; None if the file has none."""
        found = self._record.get("dt_s")
        return None if found is None else float(found)

    @cached_property
    def slow_loop(self) -> SlowLoop | None:
        """Slow loop over the range of the drive identified; None if the file has no range."""
        reached = self.drive_range
        return None if reached is None else SlowLoop.of(self.model, *reached)

    @property
    def _record(self) -> Mapping[str, Any]:
        """Entries of the file on the record identified."""
        origin: Mapping[str, Any] = self.details.get("provenance") or {}
        return origin.get("data") or {}

    @property
    def _origins(self) -> list[Mapping[str, Any]]:
        """Entries of the file on each record identified."""
        several = len(self.records) > 1
        return [one.origin for one in self.records] if several else [self._record]

    def _own(self, data: Dataset) -> FittedRecord | None:
        """Which of several records identified a record is, or is a window of."""
        return record_of(self.records, data) if len(self.records) > 1 else None

    @property
    def free_count(self) -> int | None:
        """Number of values fitted, offset and drift included; None if the file does not have it.

        Thresholds and time constants chosen beforehand are not counted; a weight that was found
        to be 0 is.
        """
        entries = self.details.get("parameters", {})
        if not any("free" in entry for entry in entries.values()):
            return None
        names = self.model.parameter_names()
        free = [name for name in names if entries.get(name, {}).get("free", False)]
        delay = bool(self.details.get("delay", {}).get("free", False))
        offsets = int(self.offset_fitted) + sum(one.offset_fitted for one in self.records[1:])
        drifts = [one for one in (self.drift, *(one.drift for one in self.records[1:])) if one]
        own = delay + offsets + sum(1 + one.time_fitted for one in drifts)
        return sum(_count(getattr(self.model, name)) for name in free) + own

    def extrapolation_notes(self, u: ArrayLike, dt: float | None = None) -> list[str]:
        """Remarks on a drive that goes beyond the range or the rate of the record identified.

        Parameters
        ----------
        u : array_like, shape (n,)
            Drive [V].
        dt : float, optional
            Sampling interval [s]; without it the rate is not judged.

        Returns
        -------
        list of str
            One sentence for each; none for a model without a record.

        Raises
        ------
        DataError, ShapeError, ParameterError
            If `u` is no sequence of finite numbers, or `dt` no interval.
        """
        rates = [one["drive_rate"] for one in self._origins if one.get("drive_rate") is not None]
        drive = signal_of("u", u)
        interval = None if dt is None else check_dt(dt)
        if not drive.size:
            raise ShapeError("u", "no samples", "at least one")
        most = float(max(rates)) if rates else None
        return extrapolation_notes(drive, interval, self.drive_range, most, self.drive_unit)

    def fitted_on(self, data: Dataset) -> bool:
        """Return whether a record is the one identified, sample by sample.

        Parameters
        ----------
        data : Dataset
            The record.

        Returns
        -------
        bool
            Whether window, warm-up and all numbers are the same.
        """
        expect("data", data, Dataset, "a Dataset")
        return any(one.get("sha256") == data.sha256 for one in self._origins)

    def window_on(self, data: Dataset) -> tuple[float, float] | None:
        """Return which window of a record was fitted, judged by the name of its file.

        Parameters
        ----------
        data : Dataset
            The record.

        Returns
        -------
        (float, float) or None
            The window [s] if it overlaps `data`; None otherwise.
        """
        expect("data", data, Dataset, "a Dataset")
        for origin in self._origins:
            window = origin.get("window_s")
            same = data.source is not None and origin.get("source") == data.source
            if same and window and window[0] <= data.t[-1] and window[1] >= data.t[0]:
                return float(window[0]), float(window[1])
        return None

    def inverse(
        self,
        *,
        playback: Literal["table", "online"] = "table",
        settle: int = 1,
        initial: StageState | None = None,
    ) -> Inverse:
        """Feedforward with the offset and the delay of this model, as `Inverse` describes.

        Parameters
        ----------
        playback : {"table", "online"}, optional
            Whether one settled period is repeated from a table, or the whole run is computed.
        settle : int, optional
            Periods before the one of the table.
        initial : StageState, optional
            State of the stage before the reference begins, as for `Inverse`.

        Returns
        -------
        Inverse
            For `Controller` or on its own. ``model.inverse()`` has no offset and no delay.
        """
        inverse: Inverse = self.model.inverse(playback=playback, settle=settle, initial=initial)
        return replace(inverse, offset=self.offset, delay=self.delay)

    def displacement(
        self, u: ArrayLike, dt: float, *, hold: Hold = "foh", initial: StageState | None = None
    ) -> Array:
        """Sensor reading under a drive, from rest.

        Parameters
        ----------
        u : array_like, shape (n,)
            Drive [V].
        dt : float
            Sampling interval [s].
        hold : {"foh", "zoh"}, optional
            As for `simulate` of the stage.
        initial : StageState, optional
            State at the first sample, as ``model.equilibrium(u[0])``; by default never driven.

        Returns
        -------
        ndarray, shape (n,)
            Displacement with offset and delay [m].
        """
        run = self.model.simulate(u, dt, hold=hold, initial=initial)
        return delayed_reading(self.model.info, run, self.delay) + self.offset

    def _delay_on(self, data: Dataset) -> float:
        """Delay of the sensor on a record [s]: its own where it is one of those identified."""
        return (self._own(data) or self).delay

    def _drift_on(self, data: Dataset) -> Array | float:
        """Drift of the sensor on a record [m]: that of the one identified, else none yet."""
        own = self._own(data) or self
        return own.drift.at(data.t) if own.drift and same_beginning(own.start, data) else 0.0

    def simulate(
        self,
        data: Dataset,
        *,
        offset: float | Literal["own"] = "own",
        history: History | None = None,
        initial: StageState | None = None,
    ) -> Response:
        """Response of the model to the drive of a record.

        Parameters
        ----------
        data : Dataset
            The record. Its warm-up is simulated too.
        offset : float or "own", optional
            Added to the displacement [m]. ``"own"``: if an offset was fitted, the one that fits
            this record's window best, otherwise none; and if a drift was fitted, on another record
            one of its own with the same time constant.
        history : {"virgin", "settled", "fit", "rest"}, optional
            What the stage went through before the record; see `identify`. Where it is not given:
            of a record identified as it was there, of another one what that record shows.
        initial : StageState, optional
            State at the first sample of the record and its warm-up, such as the `final` of the
            record before it, in place of a history.

        Returns
        -------
        Response
            Motion in the window; offset and delay are in its displacement, the rest is the
            stage's own. The delay is that of the record where it is one of those identified.
        """
        expect("data", data, Dataset, "a Dataset")
        data = data.without_faulty_readings()
        run = self._run(data, history, initial)
        drift, shift = self._added(data, run.x, offset)
        return replace(run, x=run.x + drift + shift)

    def _run(self, data: Dataset, history: History | None, initial: StageState | None) -> Response:
        """Response in the window of a record, as it is read but for an offset."""
        if data.drive_unit != (unit := self.drive_unit) and "m" in (unit, data.drive_unit):
            raise ParameterError(
                "data",
                f"a drive in {data.drive_unit}",
                f"{unit}, as that of the record identified",
                verb="has",
            )
        state = self._begins(data, history, initial)
        run, x, kept = self._motion(data, state)
        signals: dict[str, Any] = {
            signal.name: value[kept]
            for signal in fields(run)
            if isinstance(value := getattr(run, signal.name), np.ndarray)
        }
        signals |= {"t": data.t, "u": data.u, "x": x}
        windowed: Response = replace(run, **signals)
        return windowed

    def _motion(self, data: Dataset, state: StageState) -> tuple[Response, Array, slice]:
        """Response, displacement as it is read in the window, and which samples are in that."""
        u, dt, factor = data.full.u, data.dt, 1
        if self.interpolation and data.inserted is None and is_fast(data, CURVED):
            factor = self.interpolation
            u, dt = interpolated(u, factor), dt / factor
        run = self.model.simulate(u, dt, hold=data.hold, initial=state)
        kept = slice(factor * data.warmup, None, factor)
        x = delayed_reading(self.model.info, run, self._delay_on(data))[kept]
        return run, x + self._drift_on(data), kept

    def _added(
        self, data: Dataset, x: Array, offset: float | Literal["own"]
    ) -> tuple[Array | float, float]:
        """Drift and offset to add to the displacement that is simulated of a record [m]."""
        drift: Array | float = 0.0
        known = [self.start, *(one.start for one in self.records)]
        if self.drift and offset == "own" and not any(same_beginning(one, data) for one in known):
            drift = self.drift.of_another(
                data.t, data.y - x, centred=self._fits_offset(data), left_out=data.left_out
            )
        return drift, self._shift(data, x + drift, offset)

    def score(
        self,
        data: Dataset,
        *,
        offset: float | Literal["own"] = "own",
        history: History | None = None,
        initial: StageState | None = None,
    ) -> Score:
        """Deviation of the model from a record, in the record's window.

        Parameters
        ----------
        data : Dataset
            The record, e.g. one that was not fitted.
        offset : float or "own", optional
            As in `simulate`.
        history : {"virgin", "settled", "fit", "rest"}, optional
            As in `simulate`.
        initial : StageState, optional
            As in `simulate`.

        Returns
        -------
        Score
            Percentages refer to the stroke of the record identified: of one of several to its
            own, of another record to the largest.
        """
        expect("data", data, Dataset, "a Dataset")
        data = data.without_faulty_readings()
        x = self._run(data, history, initial).x
        drift, shift = self._added(data, x, offset)
        error = data.counted(data.y - x - drift - shift)
        record, largest = self._own(data), int(np.abs(error).argmax())
        return Score(
            rms=float(np.sqrt(np.mean(error**2))),
            max_error=float(abs(error[largest])),
            stroke=self.stroke if record is None else record.stroke,
            offset=shift,
            spread=float(np.std(data.counted(data.y))),
            notes=(*self.extrapolation_notes(data.u, data.dt), *data.faulty_notes),
            max_error_time=float(data.counted(data.t)[largest]),
            fitted_share=self._fitted_share(data),
        )

    def _fitted_share(self, data: Dataset) -> float:
        """Share of the samples of a record that the model was fitted to."""
        fitted = np.zeros(len(data))
        known = [(one.start, one.origin) for one in self.records] or [(self.start, self._record)]
        for start, origin in known:
            if origin.get("sha256") == data.sha256:
                return 1.0
            count, first = origin.get("samples"), origin.get("warmup_samples")
            if isinstance(count, int) and isinstance(first, int) and same_beginning(start, data):
                # Windows of one record are counted from its first sample.
                first -= data.warmup
                fitted[max(first, 0) : max(first + count, 0)] = 1.0
        return float(np.mean(data.counted(fitted)))

    def start_on(self, data: Dataset, *, history: History | None = None) -> Start:
        """Where a record begins: the state of the stage at its first sample.

        Parameters
        ----------
        data : Dataset
            The record.
        history : {"virgin", "settled", "fit", "rest"}, optional
            As in `simulate`.

        Returns
        -------
        Start
            Its `state` is in equilibrium under the first sample of the drive.
        """
        expect("data", data, Dataset, "a Dataset")
        data = data.without_faulty_readings()
        history = checked_history(history)
        own = self._own(data)
        known = self.start if own is None else own.start
        if known and same_beginning(known, data) and history in (None, known.history):
            return known
        cost = self.details.get("fit", {}).get("cost", {}).get("value", math.inf)
        return begin(
            self.model,
            data,
            history,
            self._residual,
            offset=self._fits_offset(data),
            enough=EXPLAINED * cost,
            reached=self.drive_range,
        )

    def _residual(self, data: Dataset, state: StageState) -> Array:
        """Measured less simulated displacement in the window, without offset [m]."""
        x = self._motion(data, state)[1]
        rest: Array = data.y - x - self._added(data, x, "own")[0]
        return rest

    def _fits_offset(self, data: Dataset) -> bool:
        """Whether a record gets an offset."""
        return (self._own(data) or self).offset_fitted

    def _begins(
        self, data: Dataset, history: History | None, initial: StageState | None
    ) -> StageState:
        """State at the first sample of a record."""
        if initial is None:
            return self.start_on(data, history=history).state
        if history is not None:
            raise ParameterError(
                "history", f"{history!r} beside an initial state", "one of the two"
            )
        return initial

    def _shift(self, data: Dataset, x: Array, offset: float | Literal["own"]) -> float:
        """Offset to add to a simulated displacement [m]."""
        if not (isinstance(offset, str) and offset == "own"):
            shift = _core.as_number("offset", offset)
            if not abs(shift) < LARGEST:
                raise ParameterError("offset", shift, f"'own', or m below {LARGEST:g}")
            return shift
        return float(np.mean(data.counted(data.y - x))) if self._fits_offset(data) else 0.0

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        details, info = dict(self.details), self.model.info
        kept = details.pop("parameters", {})
        delay = dict(details.pop("delay", {}))
        parameters = {
            name: entry | dict(kept.get(name, {}))
            for name, entry in parameter_entries(self.model, self.drive_unit).items()
        }
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "model": info.name,
            "parameters": parameters,
            "scale_assumed": self.scale_assumed,
            "offset": {"value": self.offset, "unit": "m", "fitted": self.offset_fitted},
            "stroke": {"value": self.stroke, "unit": "m"},
            "delay": {"value": self.delay, "unit": "s"} | delay,
            "start": start_entry(self.start, self.drive_unit),
            **drift_entry(self.drift),
            **({"interpolation": self.interpolation} if self.interpolation else {}),
            **record_entries(self.records, self.drive_unit),
            **covariance_entry(self.covariance),
            **details,
        }

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the model to a JSON file that `load` reads back bit for bit.

        Parameters
        ----------
        path : path-like
            The file. A temporary file is written and renamed, so that an existing file is replaced
            only when the new one is complete.

        Returns
        -------
        pathlib.Path
            The file written.

        Raises
        ------
        DataError
            The file cannot be written.
        ParameterError
            Offset, stroke or delay are not finite numbers, or beyond what a stage can have.
        """
        # Refuse now what `load` would refuse, while the fit still exists.
        for name in ("offset", "stroke", "delay"):
            sensor_number(name, getattr(self, name))
        return write_document(path, self.document())


def _count(value: object) -> int:
    """Return how many numbers a parameter has: several for a list, 0 for one that is None."""
    return len(value) if isinstance(value, tuple) else int(value is not None)
