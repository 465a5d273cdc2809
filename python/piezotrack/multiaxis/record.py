"""`MultiAxisRecord`: several drives and several sensors, in periods and realisations."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import _core
from .._support.arguments import expect, has_entries
from .._support.arrays import MOST_SAMPLES, check_dt, unmasked
from .._support.messages import quoted
from .._support.units import drive_text, lookup
from ..errors import DataError, ParameterError, ShapeError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    Array = NDArray[np.float64]

__all__ = ["MultiAxisRecord", "check_same", "check_skip", "relative_error"]

SHAPE = "samples x channels, samples x channels x realisations, or the same x periods"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MultiAxisRecord:
    """Drives and displacements of several axes, sampled at once.

    Parameters
    ----------
    u : array_like, shape (samples, drives[, realisations[, periods]])
        Drives [V].
    y : array_like, shape (samples, sensors[, realisations[, periods]])
        Displacements [m]; `from_um` takes them in um.
    dt : float
        Sampling interval [s].
    periods : int, optional
        Number of periods that follow each other in the samples, where the arrays have no axis of
        their own for them.
    drive_unit, output_unit : str, optional
        Units of the drives and of what the sensors read.
    source : str, optional
        Description of the record.

    Attributes
    ----------
    u, y : ndarray, shape (samples of a period, channels, realisations, periods)
        The signals.

    Raises
    ------
    ShapeError
        Dimensions, numbers of channels or lengths do not fit each other.
    DataError
        A sample is not finite, or a drive or a sensor does not move.
    ParameterError
        An argument is out of its range.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> noise = np.random.default_rng(1).normal(size=(64, 2, 4))
    >>> pt.multiaxis.MultiAxisRecord(u=noise, y=1e-6 * noise, dt=1e-3)
    <MultiAxisRecord: 2 drives, 2 sensors, 4 realisations of 1 x 64 samples, 0.916 V rms>
    """

    u: Any
    y: Any
    dt: float
    periods: int | None = None
    drive_unit: str = "V"
    output_unit: str = "m"
    source: str | None = None

    # Ratio of a line to the largest below which it is not excited.
    EXCITED: ClassVar[float] = 3e-3

    def __post_init__(self) -> None:
        object.__setattr__(self, "dt", check_dt(self.dt))
        for name in ("u", "y"):
            object.__setattr__(self, name, _signals(name, getattr(self, name), self.periods))
        for axis, words in ((0, "samples"), (2, "realisations"), (3, "periods")):
            if self.u.shape[axis] != self.y.shape[axis]:
                raise ShapeError(
                    "y", f"{self.y.shape[axis]} {words}", f"{self.u.shape[axis]}, as many as u"
                )
        object.__setattr__(self, "periods", self.u.shape[3])
        for name, words in (("u", "drive"), ("y", "sensor")):
            still = np.ptp(getattr(self, name), axis=0).max(axis=(1, 2)) == 0.0
            if still.any():
                raise DataError(
                    f"{words} {np.argmax(still)} of {name} (from 0) does not move: expected an "
                    "excitation"
                )

    def __repr__(self) -> str:
        samples, drives, realisations, periods = self.u.shape
        return (
            f"<MultiAxisRecord: {drives} drives, {self.sensors} sensors, {realisations} "
            f"realisations of {periods} x {samples} samples, "
            f"{drive_text(float(f'{self.level:.3g}'), self.drive_unit)} rms>"
        )

    @classmethod
    def from_um(cls, *, u: ArrayLike, y: ArrayLike, dt: float, **settings: Any) -> MultiAxisRecord:
        """Make a record of displacements in um.

        Parameters
        ----------
        u : array_like
            Drives [V].
        y : array_like
            Displacements [um].
        dt : float
            Sampling interval [s].
        **settings : object
            Other arguments of the class.

        Returns
        -------
        MultiAxisRecord
            The record, in SI units.
        """
        return cls(u=u, y=1e-6 * _numbers("y", y), dt=dt, **settings)

    @classmethod
    def joined(cls, records: Sequence[MultiAxisRecord]) -> MultiAxisRecord:
        """Join records of the same length as realisations of one.

        Parameters
        ----------
        records : sequence of MultiAxisRecord
            Of the same channels, samples, periods and interval.

        Returns
        -------
        MultiAxisRecord
            With the realisations of all.

        Raises
        ------
        ShapeError
            They differ in their numbers of samples, channels or periods.
        ParameterError
            There is none, or their intervals or units differ.
        """
        if not has_entries(records):
            raise ParameterError("records", quoted(records), "a list of MultiAxisRecord")
        records = list(records)
        if not records:
            raise ParameterError("records", "an empty list", "a record or more")
        for record in records:
            expect("records", record, cls, "a list of MultiAxisRecord")
        first = records[0]
        for k, record in enumerate(records):
            for name in ("u", "y"):
                mine, theirs = getattr(record, name).shape, getattr(first, name).shape
                if (mine[0], mine[1], mine[3]) != (theirs[0], theirs[1], theirs[3]):
                    raise ShapeError(
                        f"{name} of record {k}",
                        f"{mine[0]} samples, {mine[1]} channels and {mine[3]} periods",
                        f"{theirs[0]}, {theirs[1]} and {theirs[3]}, as record 0",
                    )
            check_same(records[0], record, k)
        return cls(
            u=np.concatenate([one.u for one in records], axis=2),
            y=np.concatenate([one.y for one in records], axis=2),
            dt=first.dt,
            drive_unit=first.drive_unit,
            output_unit=first.output_unit,
            source=first.source,
        )

    @classmethod
    def from_npz(
        cls,
        path: str | os.PathLike[str],
        *,
        drive: str = "u",
        output: str = "y",
        dt: float | None = None,
        **settings: Any,
    ) -> MultiAxisRecord:
        """Read a record from arrays of an ``.npz`` file of NumPy.

        Parameters
        ----------
        path : path-like
            The file.
        drive, output : str, optional
            Names of its arrays: drives [V] and displacements in `output_unit`, by default [um].
        dt : float, optional
            Sampling interval [s]; by default the number ``dt`` of the file.
        **settings : object
            Other arguments of the class; ``output_unit`` "um", the default here, another unit of
            length, or a unit in which they are kept.

        Returns
        -------
        MultiAxisRecord
            The record.

        Raises
        ------
        DataError
            The file is missing, or is none of NumPy, or has no such array.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import numpy as np
        >>> import piezotrack as pt
        >>> made = pt.multiaxis.VirtualAxes.three(noise=1e-9, seed=1).record(samples=64)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pathlib.Path(folder, "axes.npz")
        ...     np.savez(path, u=made.u, y=1e6 * made.y, dt=made.dt)
        ...     pt.multiaxis.MultiAxisRecord.from_npz(path)
        <MultiAxisRecord: 3 drives, 3 sensors, 6 realisations of 2 x 64 samples, 1 V rms>
        """
        expect("path", path, (str, os.PathLike), "the name of a file")
        try:
            with np.load(path, allow_pickle=False) as arrays:
                missing = [name for name in (drive, output) if name not in arrays.files]
                if missing:
                    raise DataError(
                        f"{path} has no array {missing[0]!r}: expected drives and displacements "
                        f"among {', '.join(arrays.files)}"
                    )
                u, y = arrays[drive], arrays[output]
                own = arrays["dt"] if "dt" in arrays.files else None
        except (OSError, ValueError, AttributeError) as error:
            if isinstance(error, DataError):
                raise
            raise DataError(f"{path} cannot be read: expected an .npz file of NumPy") from None
        settings.setdefault("source", f"{path}")
        if dt is None:
            if own is None or own.shape != () or own.dtype.kind not in "uif":
                raise DataError(
                    f"{path} has no number 'dt', the sampling interval in s: expected it there, or "
                    "dt="
                )
            dt = float(own)
        unit = lookup(settings.get("output_unit", "um"))
        if unit is not None and unit.quantity == "displacement":
            settings["output_unit"] = "m"
            y = unit.factor / unit.divisor * _numbers("y", y)
        return cls(u=u, y=y, dt=dt, **settings)

    @property
    def drives(self) -> int:
        """Number of drives."""
        return int(self.u.shape[1])

    @property
    def sensors(self) -> int:
        """Number of sensors."""
        return int(self.y.shape[1])

    @property
    def realisations(self) -> int:
        """Number of realisations."""
        return int(self.u.shape[2])

    @property
    def samples(self) -> int:
        """Number of samples of a period."""
        return int(self.u.shape[0])

    @property
    def level(self) -> float:
        """Root mean square of the drives about their means [V]."""
        return float(np.sqrt(np.mean(np.square(self.u - self.u.mean(axis=0)))))

    def only(self, realisations: Sequence[int]) -> MultiAxisRecord:
        """Return the record with some of its realisations.

        Parameters
        ----------
        realisations : sequence of int
            Their places, from 0.

        Returns
        -------
        MultiAxisRecord
            The record of these.

        Raises
        ------
        ParameterError
            There is none, or a place is beyond the last.
        """
        if not has_entries(realisations):
            raise ParameterError("realisations", quoted(realisations), "a list of places")
        places = [_core.as_count("realisations", one) for one in realisations]
        if not places or max(places) >= self.realisations:
            raise ParameterError(
                "realisations", places, f"places from 0 to {self.realisations - 1}"
            )
        return MultiAxisRecord(
            u=self.u[:, :, places],
            y=self.y[:, :, places],
            dt=self.dt,
            drive_unit=self.drive_unit,
            output_unit=self.output_unit,
            source=self.source,
        )

    def lines(self) -> NDArray[np.intp]:
        """Return the lines that all drives excite, as multiples of the inverse of the period.

        Returns
        -------
        ndarray of int, shape (n,)
            The lines, without 0 and half the sampling rate.
        """
        sizes = np.abs(np.fft.rfft(self.u.mean(axis=3), axis=0)).max(axis=2).min(axis=1)
        sizes = sizes[: (self.samples + 1) // 2]
        sizes[0] = 0.0
        return np.flatnonzero(sizes > self.EXCITED * sizes.max())


def check_same(first: MultiAxisRecord, other: MultiAxisRecord, k: int) -> None:
    """Refuse records of other intervals, channels or units than the first."""
    if abs(other.dt - first.dt) > 1e-6 * first.dt:
        raise ParameterError(
            "records", f"record {k} at {1.0 / other.dt:.6g} Hz", f"{1.0 / first.dt:.6g} Hz, as "
            "record 0", verb="have"
        )  # fmt: skip
    for words, mine, theirs in (
        ("drives", other.drives, first.drives),
        ("sensors", other.sensors, first.sensors),
    ):
        if mine != theirs:
            raise ShapeError("records", f"{mine} {words} in record {k}", f"{theirs}, as record 0")
    if (other.drive_unit, other.output_unit) != (first.drive_unit, first.output_unit):
        raise ParameterError(
            "records",
            f"record {k} in {other.drive_unit} and {other.output_unit}",
            f"{first.drive_unit} and {first.output_unit}, as record 0",
            verb="have",
        )


def check_skip(skip: int, samples: int) -> None:
    """Refuse a number of samples left out that leaves none of a period."""
    if _core.as_count("skip", skip) >= samples:
        raise ParameterError("skip", skip, f"below {samples}, the samples of a period")


def relative_error(measured: Array, simulated: Array, skip: int) -> float:
    """Return the rms error over all outputs relative to the rms of the signal.

    Parameters
    ----------
    measured, simulated : ndarray, shape (samples, sensors)
        The signals.
    skip : int
        Samples left out at the start.

    Returns
    -------
    float
        The ratio.
    """
    error = (measured - simulated)[skip:]
    return float(np.sqrt(np.sum(error * error) / np.sum(np.square(measured[skip:]))))


def _numbers(name: str, values: ArrayLike) -> Array:
    """Return an array of numbers as float64."""
    try:
        array = np.asarray(unmasked(values))
    except ValueError:
        raise ShapeError(name, "rows of unequal lengths", SHAPE) from None
    if array.dtype.kind not in "biuf":
        raise ShapeError(name, quoted(values), f"numbers of {SHAPE}", verb="is")
    return np.asarray(array, dtype=np.float64)


def _signals(name: str, values: ArrayLike, periods: int | None) -> Array:
    """Return signals as samples of a period x channels x realisations x periods."""
    array = _numbers(name, values)
    if not 2 <= array.ndim <= 4:
        raise ShapeError(name, f"{array.ndim} dimensions", SHAPE)
    if array.size > MOST_SAMPLES:
        raise ShapeError(name, f"{array.size} numbers", f"{MOST_SAMPLES} at most")
    if min(array.shape) == 0 or array.shape[0] < 4:
        raise ShapeError(name, f"the shape {array.shape}", f"four samples or more, {SHAPE}")
    if not np.isfinite(array).all():
        place = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise DataError(f"{name}{list(place)} is {array[place]}: expected finite numbers only")
    if array.ndim == 2:
        array = array[:, :, np.newaxis]
    count = 1 if periods is None else _core.as_count("periods", periods)
    if array.ndim == 4:
        if periods is not None and count != array.shape[3]:
            raise ParameterError("periods", periods, f"{array.shape[3]}, as {name} has, or none")
        return array
    if count < 1 or array.shape[0] % count:
        raise ParameterError(
            "periods", periods, f"a number of which {array.shape[0]} samples are whole periods"
        )
    samples = array.shape[0] // count
    split = array.reshape(count, samples, *array.shape[1:])
    return np.ascontiguousarray(np.moveaxis(split, 0, -1))
