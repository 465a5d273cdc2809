"""Record of one axis of a stage: drive voltage and displacement."""

from __future__ import annotations

from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from .._support.arguments import one_of
from .._support.arrays import signal_of, time_axis
from .._support.display.frames import frame_of
from .._support.display.result import Viewed
from .._support.messages import quoted
from .._support.units import best_length_unit
from ..errors import DataError, ParameterError
from .dataset_arguments import (
    MIN_SAMPLES,
    decimation_factor,
    further_columns,
    interpolation_factor,
    window_samples,
)
from .far_readings import are_few, bridged, far_notes, far_readings
from .missing import USE_MISSING, checked_missing, complete, thinned
from .sensor_end import end_mask, end_note, sensor_ends

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from .frames import Frame
    from .missing import Missing
    from .sensor_end import SensorEnd

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

__all__ = ["Dataset", "Hold"]

Hold = Literal["foh", "zoh"]

# Share of its range by which a drive has left its first sample.
STANDS = 2e-3


class Dataset(Viewed):
    """An evenly sampled record of one axis, in seconds, volts and metres.

    Parameters
    ----------
    u : array_like, shape (n,)
        Drive [V].
    y : array_like, shape (n,)
        Displacement [m].
    t : array_like, shape (n,), optional
        Time of each sample [s], increasing and even. Give either `t` or `dt`.
    dt : float, optional
        Sampling interval [s]; the first sample is then at 0 s.
    hold : {"foh", "zoh"}, optional
        Drive between two samples: ``"foh"`` is linear, ``"zoh"`` is constant, as the output of a
        digital controller.
    drive_unit : str, optional
        Unit of `u`: ``"V"``, ``"N"`` for a force, ``"m"`` where the drive is a position, as the
        height (piezo) of an AFM.
    columns : mapping of str to array_like, shape (n,), optional
        Further signals of the same record. They may hold NaN.
    column_units : mapping of str to str, optional
        Units of `columns`, for labels.
    source : str, optional
        Where the record comes from, e.g. the name of a file.
    notes : sequence of str, optional
        What a person should know of its source, as that a unit is not the one of the file.
    missing : {"drop", "fill"}, optional
        What becomes of readings that are NaN. ``"drop"``: the samples stay, because the stage
        moves on through them, but their displacement does not count in a fit or a score.
        ``"fill"``: it counts as on the straight line between the readings beside. A drive that is
        missing is on such a line in both cases, or constant with ``"zoh"``. `notes` has how
        many. They are refused where it is not given.

    Raises
    ------
    ShapeError
        An array is not one-dimensional, or the lengths differ.
    DataError
        There are fewer than 3 samples, a sample is not a finite number, or `t` is not
        increasing or not even (off by more than 5 % of the interval).
    ParameterError
        `t` and `dt` are both given or both missing, another argument has a value that cannot be
        used, or a window reaches out of the record or holds fewer than 3 samples.

    Notes
    -----
    A slice in seconds is a window: ``log[3.0:23.0]`` has the samples with 3 s <= t < 23 s. The
    drive before the window is kept as warm-up, because hysteresis has memory; the samples after
    the window are dropped. The bounds are times on the record's own axis and have to lie in it. A
    window of a window narrows it. `cut` makes a window without warm-up.

    A dataset does not change, and its arrays are read-only. It unpacks as ``u, y = log``.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> u = 5.0 * np.sin(np.arange(5000) / 500.0)
    >>> log = pt.Dataset(u=u, y=4e-6 * u, dt=0.005)
    >>> log
    Dataset(5000 samples, 25 s at 200 Hz, stroke 40 um)
    >>> log[3.0:23.0]
    Dataset(4000 samples, 20 s at 200 Hz, stroke 40 um, warm-up 600 samples)
    >>> log.cut(3.0, 23.0).warmup
    0
    """

    views: ClassVar[Mapping[str, str]] = {
        "plot": "data.views.dataset_plot:plot_dataset",
        "html": "data.views.dataset_table:dataset_html",
    }

    def __init__(
        self,
        *,
        u: ArrayLike,
        y: ArrayLike,
        t: ArrayLike | None = None,
        dt: float | None = None,
        hold: Hold = "foh",
        drive_unit: str = "V",
        columns: Mapping[str, ArrayLike] | None = None,
        column_units: Mapping[str, str] | None = None,
        source: str | None = None,
        notes: Sequence[str] = (),
        missing: Missing = None,
    ) -> None:
        one_of("hold", hold, ("foh", "zoh"))
        for name, text in (("drive_unit", drive_unit), ("source", source or "")):
            if not isinstance(text, str):
                raise ParameterError(name, quoted(text), "text")
        # The arrays hold the warm-up and the window, which begins at sample `_start`.
        finite = checked_missing(missing) is None
        self._u = signal_of("u", u, finite=finite, remedy=USE_MISSING)
        self._y = signal_of("y", y, like=self._u, finite=finite, remedy=USE_MISSING)
        filled = complete(self._u, self._y, missing, constant=hold == "zoh")
        # Displacement as it was read, where it does not count everywhere.
        self._left_out, self._recorded = filled.left_out, None
        if self._left_out is not None:
            self._recorded = signal_of("y", np.where(self._left_out, np.nan, self._y), finite=False)
        if not finite:
            self._u, self._y = signal_of("u", filled.u), signal_of("y", filled.y)
        if self._u.size < MIN_SAMPLES:
            raise DataError(f"u has {self._u.size} samples: expected at least {MIN_SAMPLES}")
        self._t, self._dt = time_axis(t, dt, self._u)
        self._columns, self._column_units = further_columns(columns, column_units, self._u)
        self._hold, self._drive_unit, self._source = hold, drive_unit, source
        self._notes = (*map(str, notes), *filled.notes)
        self._start, self._zero = 0, 0.0
        self._sha256: str | None = None
        self._far: Mask | None = None
        self._at_end: Mask | None = None
        # Samples that `interpolate` put between the measured ones, and the interval of these.
        self._inserted: Mask | None = None
        self._measured_dt: float | None = None

    @classmethod
    def from_frame(
        cls,
        frame: Frame,
        *,
        time: str | int | None = None,
        drive: str | int | None = None,
        displacement: str | int | None = None,
        units: Mapping[str | int, str] | None = None,
        dt: float | None = None,
        hold: Hold = "foh",
        missing: Missing = None,
    ) -> Dataset:
        """Make a record of a data frame, of pandas or polars.

        Parameters
        ----------
        frame : DataFrame
            With one row for each sample. Titles have units, as in a text log: ``voltage_V``,
            ``x (um)``.
        time, drive, displacement, units, dt, hold, missing
            As in `piezotrack.read`.

        Returns
        -------
        Dataset
            The record in seconds, volts and metres.

        Raises
        ------
        DataError, ParameterError
            As in `piezotrack.read`.

        Examples
        --------
        >>> import pandas as pd
        >>> import piezotrack as pt
        >>> frame = pd.DataFrame({"t_ms": [0, 5, 10], "u_V": [0, 10, 20], "x_um": [0, 1.5, 3.5]})
        >>> pt.Dataset.from_frame(frame)
        Dataset(3 samples, 0.015 s at 200 Hz, stroke 3.5 um)
        """
        from .frames import signals_of_frame

        signals, drive_unit = signals_of_frame(
            frame,
            time=time,
            drive=drive,
            displacement=displacement,
            units=units,
            needs_time=dt is None,
        )
        return cls(
            u=signals["drive"],
            y=signals["displacement"],
            t=signals.get("time"),
            dt=dt,
            hold=hold,
            drive_unit=drive_unit,
            source="data frame",
            missing=missing,
        )

    def to_frame(self) -> Any:
        """Return the window as a data frame of pandas.

        Returns
        -------
        pandas.DataFrame
            ``time_s``, the drive in its unit and ``displacement_um``.

        Raises
        ------
        ParameterError
            pandas is not installed.

        Examples
        --------
        >>> import piezotrack as pt
        >>> list(pt.datasets.dbo_training()[3.0:4.0].to_frame().columns)
        ['time_s', 'drive_V', 'displacement_um']
        """
        drive = {f"drive_{self.drive_unit}": self.u}
        return frame_of({"time_s": self.t, **drive, "displacement_um": 1e6 * self.recorded})

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the window as a log that `piezotrack.read` reads: the same numbers, in SI.

        Parameters
        ----------
        path : path-like
            The file. Its ending says the format: ``.csv``, ``.npz``, ``.mat`` (MAT v5) or
            ``.parquet`` (needs pyarrow: ``pip install piezotrack[parquet]``). One that exists is
            replaced.

        Returns
        -------
        pathlib.Path
            The file.

        Raises
        ------
        ParameterError
            The ending is another one.
        DataError
            The file cannot be written, or the library for its format is not installed.

        Notes
        -----
        The warm-up is left out; ``log.full.save(path)`` writes it as samples. Times, drive,
        displacement and further columns are read back to the last bit. A further column with a
        usual name, as ``y``, is written as ``column y``. In a MAT file a name that MATLAB does not
        take becomes one that it does, and the units are in the structure ``units``.

        Examples
        --------
        >>> import numpy as np
        >>> import piezotrack as pt
        >>> u = 5.0 * np.sin(np.arange(5000) / 500.0)
        >>> log = pt.Dataset(u=u, y=4e-6 * u, dt=0.005)
        >>> bool(np.array_equal(pt.read(log.save("log.npz")).y, log.y))
        True
        """
        from .log_file import save_log

        return save_log(self, path)

    @property
    def t(self) -> Array:
        """Times of the samples in the window [s], shape (n,)."""
        return self._t[self._start :]

    @property
    def u(self) -> Array:
        """Drive in the window [V], in `drive_unit` where that is another; shape (n,)."""
        return self._u[self._start :]

    @property
    def y(self) -> Array:
        """Displacement in the window [m], shape (n,)."""
        return self._y[self._start :]

    @property
    def recorded(self) -> Array:
        """Displacement as it was read [m], NaN where it is missing; shape (n,).

        It differs from `y` where `left_out` says so.
        """
        return (self._y if self._recorded is None else self._recorded)[self._start :]

    @property
    def left_out(self) -> Mask | None:
        """Samples in the window whose displacement does not count; None where all count.

        There `y` is on the straight line between the readings beside, or interpolated.
        """
        return None if self._left_out is None else self._left_out[self._start :]

    @property
    def inserted(self) -> Mask | None:
        """Samples in the window that `interpolate` put between the measured ones; None without any.

        They are among those of `left_out`.
        """
        return None if self._inserted is None else self._inserted[self._start :]

    def at_readings(self, values: Array) -> Array:
        """Return the entries of values in the window without those at `inserted` samples.

        Parameters
        ----------
        values : ndarray, shape (n,)
            One for each sample.

        Returns
        -------
        ndarray
            `values` where none was inserted.
        """
        return values if self.inserted is None else values[~self.inserted]

    @property
    def measured(self) -> Dataset:
        """The record without the samples of `inserted`; the record itself without any."""
        if self._inserted is None:
            return self
        kept = ~self._inserted
        part = self._part(0, self._u.size, start=int(kept[: self._start].sum()))
        part._select(kept)
        part._dt, part._inserted, part._measured_dt = self.measured_dt, None, None
        if part._left_out is not None and not part._left_out.any():
            part._left_out = None
        return part

    @property
    def far(self) -> Mask:
        """Samples in the window that are single readings far off, shape (n,)."""
        return self._far_of_all[self._start :]

    @property
    def _far_of_all(self) -> Mask:
        """Single readings far off, those of the warm-up too."""
        if self._far is None:
            kept = slice(None) if self._inserted is None else ~self._inserted
            self._far = np.zeros(self._u.size, dtype=np.bool_)
            self._far[kept] = far_readings(self._u[kept], self._y[kept])
        return self._far

    @property
    def far_notes(self) -> list[str]:
        """A sentence on the single readings far off that are in the window; none without any."""
        return far_notes(self.t, self.recorded, self.far)

    @property
    def at_end(self) -> Mask:
        """Readings in the window where the sensor or the stage is at its end, shape (n,).

        No reading where these would be more than half of the record.
        """
        return self._at_end_of_all[self._start :]

    @property
    def _at_end_of_all(self) -> Mask:
        """Readings at an end, those of the warm-up too."""
        if self._at_end is None:
            kept = slice(None) if self._inserted is None else ~self._inserted
            u, y = self._u[kept], self._without_single_ones[kept]
            self._at_end = np.zeros(self._u.size, dtype=np.bool_)
            self._at_end[kept] = end_mask(sensor_ends(u, y), y.size)
        return self._at_end

    @property
    def _without_single_ones(self) -> Array:
        """Displacement as it was read, with straight lines where it is missing or far off."""
        read = self._y if self._recorded is None else self._recorded
        return bridged(read, np.isnan(read) | self._far_of_all)

    @property
    def ends(self) -> list[SensorEnd]:
        """Ends of the sensor or of the stage that the window shows."""
        return sensor_ends(self.u, self._without_single_ones[self._start :])

    @property
    def faulty_notes(self) -> list[str]:
        """A sentence on single readings far off, and on each end; none of a sound window."""
        left_out = bool(self.at_end.any())
        notes = [end_note(end, self._drive_unit, left_out=left_out) for end in self.ends]
        return [*self.far_notes, *notes]

    def counted(self, values: Array) -> Array:
        """Return the entries of values in the window at the samples that count.

        Parameters
        ----------
        values : ndarray, shape (n,)
            One for each sample.

        Returns
        -------
        ndarray
            `values` where all of them count.
        """
        return values if self._left_out is None else values[~self._left_out[self._start :]]

    def without_faulty_readings(self) -> Dataset:
        """Return the record without faulty readings, as `identify` and scores take it.

        Single readings far off are left out, if they are not more than one in a hundred, and those
        where the sensor or the stage is at its end: `far` and `at_end`.

        Returns
        -------
        Dataset
            The record itself where there are none. Its `left_out` has them; `recorded` and
            `sha256` are those of before.

        Examples
        --------
        >>> import numpy as np
        >>> import piezotrack as pt
        >>> u = np.sin(np.arange(4000) / 300.0)
        >>> y = 20e-6 * u
        >>> y[471] += 30e-6
        >>> log = pt.Dataset(u=u, y=y, dt=0.001)
        >>> f"{log.stroke * 1e6:.0f} um, {log.without_faulty_readings().stroke * 1e6:.0f} um"
        '70 um, 40 um'
        """
        # Those of the warm-up, which does not count, have no effect.
        mask = self._at_end_of_all
        if are_few(self.far):
            mask = mask | self._far_of_all
        faulty, left_out = mask[self._start :], self.left_out
        if not faulty.any() or (left_out is not None and left_out[faulty].all()):
            return self
        part = self._part(0, self._u.size, start=self._start)
        mask = mask if self._left_out is None else self._left_out | mask
        part._recorded = self._y if self._recorded is None else self._recorded
        part._y, part._left_out = signal_of("y", bridged(self._y, mask)), mask
        return part

    @property
    def dt(self) -> float:
        """Sampling interval [s]."""
        return self._dt

    @property
    def measured_dt(self) -> float:
        """Interval of the measured samples [s]: of an interpolated record longer than `dt`."""
        return self._dt if self._measured_dt is None else self._measured_dt

    @property
    def hold(self) -> Hold:
        """Drive between two samples: ``"foh"`` (linear) or ``"zoh"`` (constant)."""
        return self._hold

    @property
    def drive_unit(self) -> str:
        """Unit of `u`."""
        return self._drive_unit

    @property
    def columns(self) -> Mapping[str, Array]:
        """Further signals in the window by name, each of shape (n,)."""
        return MappingProxyType({k: v[self._start :] for k, v in self._columns.items()})

    @property
    def column_units(self) -> Mapping[str, str]:
        """Units of `columns` by name; an empty text where there is none."""
        return MappingProxyType(self._column_units)

    @property
    def source(self) -> str | None:
        """Where the record comes from, e.g. the name of a file."""
        return self._source

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on its source; an identification repeats them as warnings."""
        return self._notes

    @property
    def warmup(self) -> int:
        """Number of samples kept in front of the window."""
        return self._start

    @property
    def full(self) -> Dataset:
        """The window together with its warm-up, all of them as ordinary samples."""
        return self._part(0, self._u.size, start=0)

    @property
    def zero(self) -> float:
        """Displacement of the source that `zeroed` subtracted [m]; 0 where nothing was."""
        return self._zero

    @property
    def duration(self) -> float:
        """Length of the window [s]: its number of samples times `dt`."""
        return len(self) * self._dt

    @property
    def stroke(self) -> float:
        """Largest less smallest displacement in the window [m]."""
        return float(self.y.max()) - float(self.y.min())

    @property
    def sha256(self) -> str:
        """Fingerprint of the numbers, 64 hexadecimal digits.

        SHA-256 over little-endian float64: `dt`, all of `full.u`, all of `full.recorded`, `warmup`;
        of an interpolated record also `measured_dt`.
        """
        if self._sha256 is None:
            import hashlib

            digest = hashlib.sha256()
            recorded = self._y if self._recorded is None else self._recorded
            measured = () if self._measured_dt is None else (self._measured_dt,)
            for part in (self._dt, self._u, recorded, self._start, *measured):
                digest.update(np.asarray(part, dtype="<f8").tobytes())
            self._sha256 = digest.hexdigest()
        return self._sha256

    def __len__(self) -> int:
        return int(self._u.size) - self._start

    def __iter__(self) -> Iterator[Array]:
        return iter((self.u, self.y))

    def __getitem__(self, window: slice) -> Dataset:
        if not isinstance(window, slice):
            raise ParameterError(
                "window",
                quoted(window),
                "a slice in seconds, as in log[3.0:23.0]; for single samples use log.u, log.y and "
                "log.t",
            )
        if window.step is not None:
            raise ParameterError(
                "window", f"a step of {quoted(window.step)}", "log[start:stop], in s", verb="has"
            )
        first, stop = self._samples(window.start, window.stop)
        return self._part(0, stop, start=first)

    def cut(self, start: float | None = None, stop: float | None = None) -> Dataset:
        """Return the window from `start` to `stop` without the drive before it.

        Parameters
        ----------
        start, stop : float, optional
            Bounds on the record's own time axis [s]; used and checked as in ``log[start:stop]``.
        """
        first, end = self._samples(start, stop)
        return self._part(first, end, start=0)

    def decimate(self, factor: int) -> Dataset:
        """Return the record at a lower sampling rate, low-pass filtered before.

        Drive, displacement and further columns go through the same low-pass filter, which
        has no phase lag: a finite impulse response with 80 dB from 1.2 times the new
        Nyquist frequency on, flat up to 0.8 times. The drive then goes straight from sample to
        sample.

        Parameters
        ----------
        factor : int
            How many samples become one, 2 or more.

        Returns
        -------
        Dataset
            The window begins with the same sample as before.

        Raises
        ------
        ParameterError
            `factor` is not a whole number of 2 or more, or leaves fewer than 3 samples.

        Examples
        --------
        >>> import numpy as np
        >>> import piezotrack as pt
        >>> u = np.sin(np.arange(5000) / 500.0)
        >>> pt.Dataset(u=u, y=1e-6 * u, dt=0.001).decimate(10).dt
        0.01
        """
        from .rates import at_lower_rate

        factor = decimation_factor(factor, len(self))
        first = self._start % factor
        whole = self.without_faulty_readings()
        less = whole._resampled(*at_lower_rate(self._t, factor, first))
        if whole is not self:
            less._notes += tuple(self.faulty_notes)
        less._left_out = thinned(whole._left_out, factor, first)
        less._inserted = thinned(self._inserted, factor, first)
        less._measured_dt = None if less._inserted is None else self._measured_dt
        return less._part(0, len(less), start=self._start // factor)

    def interpolate(self, factor: int) -> Dataset:
        """Return the record at a higher sampling rate, interpolated between the samples.

        For a drive whose highest frequencies are near half the sampling rate, where a line from
        sample to sample falls short: at a tenth of the sampling rate by 3 %. Drive, displacement
        and further columns are interpolated band-limited, exactly up to 0.8 times the old
        Nyquist frequency (80 dB), and keep their samples. Only for a drive that the low-pass
        before the log, or the signal itself, kept below that; not for steps.

        `identify` does it by itself where it lowers the residual. What is inserted moves the stage,
        but is no reading: it does not count in a fit, a score or an estimate of the noise.

        Parameters
        ----------
        factor : int
            How many samples one becomes, 2 or more.

        Returns
        -------
        Dataset
            The window begins with the same sample as before; the drive goes straight from sample
            to sample. `inserted` has the new samples, `measured` is the record without them.

        Raises
        ------
        ParameterError
            `factor` is not a whole number of 2 or more, or makes more than 50 million samples;
            or the record's hold is "zoh", which already defines the drive between the samples.

        Examples
        --------
        >>> import numpy as np
        >>> import piezotrack as pt
        >>> t = np.arange(2000) / 1000.0
        >>> log = pt.Dataset(u=np.sin(2 * np.pi * 200 * t), y=np.cos(2 * np.pi * 200 * t), t=t)
        >>> fine = log.interpolate(5)
        >>> error = fine.u - np.sin(2 * np.pi * 200 * fine.t)
        >>> bool(np.abs(error[500:-500]).max() < 2e-4)
        True
        """
        from .rates import at_higher_rate

        factor = interpolation_factor(factor, self._t.size, self._hold)
        whole = self.without_faulty_readings()
        fine = whole._resampled(*at_higher_rate(self._t, self._dt, factor))
        if whole is not self:
            fine._notes += tuple(self.faulty_notes)
        fine._inserted = np.ones(fine._u.size, dtype=np.bool_)
        fine._inserted[::factor] = False if self._inserted is None else self._inserted
        fine._left_out = fine._inserted.copy()
        if whole._left_out is not None:
            fine._left_out[::factor] = whole._left_out
        fine._measured_dt = self.measured_dt
        return fine._part(0, len(fine), start=self._start * factor)

    def zeroed(self) -> Dataset:
        """Return the record with displacements that count from its beginning.

        What is subtracted is the median of the readings, warm-up included, up to where the drive
        first leaves its first sample by 0.2 % of its range; the first reading where it moves at
        once. Readings that do not count are left aside.

        Returns
        -------
        Dataset
            The record, whose `zero` is what was subtracted. A window and its record have the same.

        Examples
        --------
        >>> import numpy as np
        >>> import piezotrack as pt
        >>> u = np.r_[np.zeros(100), 30.0 - 30.0 * np.cos(np.arange(5000) / 500.0)]
        >>> log = pt.Dataset(u=u, y=1e-6 * u - 120e-6, dt=0.005).zeroed()
        >>> f"{1e6 * log.y[0]:.1f} um, {1e6 * log.zero:.1f} um"
        '0.0 um, -120.0 um'
        """
        begun = np.abs(self._u - self._u[0]) > STANDS * float(np.ptp(self._u))
        still = slice(0, max(1, int(np.argmax(begun))) if begun.any() else self._u.size)
        counts = ~self._far_of_all[still]
        if self._left_out is not None:
            counts &= ~self._left_out[still]
        # On a straight line where no reading counts.
        zero = float(np.median(self._y[still][counts] if counts.any() else self._y[still]))
        part = self._part(0, self._u.size, start=self._start)
        part._y, part._zero = signal_of("y", self._y - zero), self._zero + zero
        if self._recorded is not None:
            part._recorded = signal_of("y", self._recorded - zero, finite=False)
        return part

    def _resampled(self, times: Array, change: Callable[[Array], Array]) -> Dataset:
        """Change all signals and the warm-up; the drive then goes straight between samples."""
        changed = Dataset(
            u=change(self._u),
            y=change(self._y),
            t=times,
            hold="foh",
            drive_unit=self._drive_unit,
            columns={name: change(values) for name, values in self._columns.items()},
            column_units=self._column_units,
            source=self._source,
            notes=self._notes,
        )
        changed._zero = self._zero
        return changed

    def _preceded(self, u: float, within: bool) -> Dataset:
        """Put a sample with a drive of `u` before all others; its displacement does not count.

        The drive jumps at the sample that was the first, or within the interval before.
        """
        longer = Dataset(
            u=np.concatenate(([u], self._u)),
            y=np.concatenate((self._y[:1], self._y)),
            dt=self._dt,
            hold=self._hold,
            drive_unit=self._drive_unit,
            source=self._source,
        )
        if self._hold == "foh" and not within:
            longer._hold = "jump"  # type: ignore[assignment]
        for name in ("_left_out", "_inserted"):
            if (mask := getattr(self, name)) is not None:
                setattr(longer, name, np.concatenate(([True], mask)))
        longer._measured_dt = self._measured_dt
        return longer._part(0, longer._u.size, start=self._start + 1)

    def _samples(self, start: float | None, stop: float | None) -> tuple[int, int]:
        """Turn the bounds of a window [s] into indices of the arrays."""
        first, last = window_samples(self.t, self._dt, start, stop)
        if self.inserted is not None and not self.inserted[first:last].all():
            # A window begins with a measured sample.
            first += int(np.argmin(self.inserted[first:last]))
        return self._start + first, self._start + last

    def _part(self, first: int, stop: int, start: int) -> Dataset:
        """Keep samples `first` to `stop` of the arrays and begin the window at `start`."""
        part = object.__new__(type(self))
        part.__dict__.update(self.__dict__)
        part._select(slice(first, stop))
        part._start, part._sha256 = start, None
        return part

    def _select(self, kept: slice | Mask) -> None:
        """Keep some of the samples of a new record."""
        for name in ("_t", "_u", "_y", "_recorded", "_left_out", "_far", "_at_end", "_inserted"):
            values = getattr(self, name)
            setattr(self, name, None if values is None else values[kept])
        self._columns = {name: a[kept] for name, a in self._columns.items()}
        for array in (self._t, self._u, self._y, *self._columns.values()):
            array.setflags(write=False)

    def __repr__(self) -> str:
        unit, scale = best_length_unit(self.stroke)
        parts = [
            f"{len(self)} samples",
            f"{self.duration:.6g} s at {1.0 / self.dt:.6g} Hz",
            f"stroke {self.stroke * scale:.3g} {unit}",
        ]
        if self._inserted is not None:
            parts.append(f"interpolated from {1.0 / self.measured_dt:.6g} Hz")
        if self.warmup:
            parts.append(f"warm-up {self.warmup} samples")
        return f"Dataset({', '.join(parts)})"

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        # Pickles and deep copies do not carry the read-only flag.
        for array in (self._t, self._u, self._y, *self._columns.values()):
            array.setflags(write=False)
