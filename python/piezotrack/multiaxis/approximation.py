"""Best linear approximation of a record of several axes, with noise and distortion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._support.arguments import expect, in_range
from ..errors import DataError
from ..response.best_linear_approximation import spectra
from .record import MultiAxisRecord, check_skip, relative_error

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

__all__ = ["MultiAxisResponse", "approximate_axes", "smoothed"]

# Lines on each side over which variances are averaged, and passes of the weights.
SMOOTH, PASSES = 5, 4
# Least variance of the distortion, in medians of the noise: weights stay finite.
FLOOR = 0.05
# Noise of a realisation in medians of all, from which it is named.
NOISY = 3.0
# Largest rms difference of the periods of a drive, relative to its rms.
REPEATS = 0.2
# Largest condition number of the drives at a line.
CONDITION = 1e6
# Variance of a response without noise, relative to its mean square.
NOISELESS = 1e-18


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MultiAxisResponse:
    """Frequency responses from all drives to all sensors at some lines, with their variances.

    Attributes
    ----------
    frequency : ndarray, shape (k,)
        Lines, rising [Hz].
    value : ndarray of complex, shape (k, sensors, drives)
        Responses [m/V].
    variance : ndarray, shape (k, sensors, drives)
        Expectation of their squared errors, of noise and distortion [m^2/V^2].
    degrees : int
        Real degrees of freedom of the variances, smoothed over neighbouring lines.
    distortion : ndarray or None, shape (k, sensors)
        Variance of the nonlinear distortion of the displacement of one realisation [m^2]; None
        where there are as many realisations as drives.
    noise : ndarray or None, shape (k, sensors, realisations)
        Variance of the noise of the displacement averaged over the periods [m^2]; None of one
        period.
    power : ndarray, shape (k,)
        Mean square of the drives [V^2].
    level : float
        Root mean square of the drives about their means [V].
    drive_mean, output_mean : ndarray, shape (drives,) and (sensors,)
        Means over the record [V] and [m].
    dt : float
        Sampling interval [s].
    samples : int
        Number of samples of a period.
    notes : tuple of str
        Warnings, one sentence each.
    """

    frequency: Array
    value: Complex
    variance: Array
    degrees: int
    distortion: Array | None
    noise: Array | None
    power: Array
    level: float
    drive_mean: Array
    output_mean: Array
    dt: float
    samples: int
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        _, sensors, drives = self.value.shape
        ends = f"{self.frequency[0]:.4g} to {self.frequency[-1]:.4g} Hz"
        return (
            f"<MultiAxisResponse: {sensors} x {drives}, {self.frequency.size} lines, {ends}, "
            f"{self.level:.3g} V rms>"
        )

    @property
    def z(self) -> Complex:
        """Points of the unit circle at the lines."""
        return np.asarray(np.exp(2j * np.pi * self.frequency * self.dt))

    def band(self, level: float = 0.95) -> Array:
        """Return the radius of the regions that hold the responses with some probability.

        Parameters
        ----------
        level : float, optional
            Probability, at each line by itself; the quantile is that of `FrequencyResponse.band`.

        Returns
        -------
        ndarray, shape (k, sensors, drives)
            Radius [m/V].

        Raises
        ------
        ParameterError
            `level` is not between 0 and 1.
        """
        level = in_range("level", level, 0.9999, "probability")
        half = 0.5 * self.degrees
        quantile = half * ((1.0 - level) ** (-1.0 / half) - 1.0)
        return np.asarray(np.sqrt(self.variance * quantile))

    def score(self, record: MultiAxisRecord, *, skip: int = 100) -> Array:
        """Return the error of the steady displacement that the responses predict.

        Parameters
        ----------
        record : MultiAxisRecord
            Of the same period and interval, its drives on the same lines.
        skip : int, optional
            Samples left out at the start of each period.

        Returns
        -------
        ndarray, shape (realisations,)
            Rms error over all sensors and periods, relative to the rms of the displacement.

        Raises
        ------
        DataError
            The record has another period or interval.
        ParameterError
            `skip` leaves nothing.
        """
        expect("record", record, MultiAxisRecord, "a MultiAxisRecord")
        if record.samples != self.samples or abs(record.dt - self.dt) > 1e-6 * self.dt:
            raise DataError(
                f"the record has periods of {record.samples * record.dt:.6g} s: expected "
                f"{self.samples * self.dt:.6g} s, as the response"
            )
        check_skip(skip, record.samples)
        places = np.round(self.frequency * self.samples * self.dt).astype(np.intp)
        errors = []
        for r in range(record.realisations):
            drive = record.u[:, :, r].mean(axis=2)
            found = np.fft.rfft(drive, axis=0)
            answer = np.zeros((found.shape[0], record.sensors), dtype=np.complex128)
            answer[places] = np.einsum("kij,kj->ki", self.value, found[places])
            steady = np.fft.irfft(answer, self.samples, axis=0)
            measured = np.moveaxis(record.y[:, :, r], 2, 0)
            measured = measured - measured.mean(axis=(0, 1))
            together = [relative_error(one, steady, skip) for one in measured]
            errors.append(float(np.sqrt(np.mean(np.square(together)))))
        return np.array(errors)


def approximate_axes(record: MultiAxisRecord) -> MultiAxisResponse:
    r"""Estimate the best linear approximation of several axes from a periodic record.

    At each line the responses follow from all realisations by least squares, each weighted by the
    inverse of the variance of its noise, which the periods show, and of the nonlinear distortion,
    which the realisations show:

    .. math:: \hat G = (\sum_r w_r Y_r U_r^H) (\sum_r w_r U_r U_r^H)^{-1}

    Pintelon and Schoukens, System Identification, 2nd ed., 2012, chapters 3 and 4. Variances are
    averaged over neighbouring lines. Drives may be orthogonal blocks of random-phase multisines,
    or any independent realisations on the same lines.

    Parameters
    ----------
    record : MultiAxisRecord
        Whole periods in steady state.

    Returns
    -------
    MultiAxisResponse
        The responses at the excited lines.

    Raises
    ------
    DataError
        There are fewer realisations than drives, or they do not tell the drives apart; or as many
        of them, with one period.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.multiaxis.VirtualAxes.three(noise=1e-9, seed=1)
    >>> response = pt.multiaxis.approximate_axes(stage.record(realisations=4))
    >>> response
    <MultiAxisResponse: 3 x 3, 449 lines, 1.953 to 877 Hz, 1 V rms>
    """
    expect("record", record, MultiAxisRecord, "a MultiAxisRecord")
    _check_realisations(record)
    lines = record.lines()
    drive, output = _spectra(record.u, lines), _spectra(record.y, lines)
    u, y = drive.mean(axis=3), output.mean(axis=3)
    _check_drives(record, drive)
    periods = record.u.shape[3]
    noise = None
    if periods > 1:
        # Noise of the drive moves the displacement too: what it explains is none of the sensor.
        spread = np.square(np.abs(output - y[..., np.newaxis])).sum(axis=3)
        noise = smoothed(spread / (periods - 1) / periods)
    value, variance, distortion = _weighted(u, y, noise)
    free = max(record.realisations - record.drives, periods - 1)
    least = NOISELESS * np.mean(np.square(np.abs(value)))
    return MultiAxisResponse(
        frequency=lines / (record.samples * record.dt),
        value=value,
        variance=np.maximum(variance, least),
        degrees=2 * free * (2 * SMOOTH + 1),
        distortion=distortion,
        noise=noise,
        power=0.5 * np.square(np.abs(u)).mean(axis=(1, 2)),
        level=record.level,
        drive_mean=record.u.mean(axis=(0, 2, 3)),
        output_mean=record.y.mean(axis=(0, 2, 3)),
        dt=record.dt,
        samples=record.samples,
        notes=_notes(record, y, noise, distortion),
    )


def _spectra(signals: Array, lines: NDArray[np.intp]) -> Complex:
    """Return the lines of signals, shape (lines, channels, realisations, periods)."""
    # Of each channel: realisations, periods, samples.
    channels = [spectra(np.moveaxis(signals[:, j], 0, -1), lines) for j in range(signals.shape[1])]
    return np.asarray(np.moveaxis(np.stack(channels), (3, 0, 1, 2), (0, 1, 2, 3)))


def smoothed(values: Array, beside: int = SMOOTH) -> Array:
    """Return the mean of neighbouring lines on both sides, along the first axis."""
    sums = np.cumsum(np.concatenate([np.zeros((1, *values.shape[1:])), values]), axis=0)
    count = len(values)
    first = np.maximum(np.arange(count) - beside, 0)
    last = np.minimum(np.arange(count) + beside + 1, count)
    width = (last - first).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((sums[last] - sums[first]) / width)


def _weighted(u: Complex, y: Complex, noise: Array | None) -> tuple[Complex, Array, Array | None]:
    """Return responses, their variances, and the variance of the distortion of a realisation."""
    count, drives, realisations = u.shape
    sensors = y.shape[1]
    free = realisations > drives
    scatter = np.zeros((count, sensors, realisations)) if noise is None else noise
    weights = np.ones((count, sensors, realisations))
    distortion = None
    for _ in range(PASSES if free else 1):
        value = np.empty((count, sensors, drives), dtype=np.complex128)
        spread = np.empty((count, sensors, drives))
        excess, sizes = np.empty((count, sensors)), np.empty((count, sensors))
        for i in range(sensors):
            w = weights[:, i]
            inverse = np.linalg.inv(np.einsum("kar,kr,kbr->kab", u, w, u.conj()))
            # Columns of the least-squares solution: value = y @ solution.
            solution = np.einsum("kr,kbr,kba->kra", w, u.conj(), inverse)
            value[:, i] = np.einsum("kr,kra->ka", y[:, i], solution)
            rest = np.square(np.abs(y[:, i] - np.einsum("ka,kar->kr", value[:, i], u)))
            leverage = np.einsum("kar,kra->kr", u, solution).real
            variance = (
                scatter[:, i]
                if distortion is None
                else scatter[:, i] + distortion[:, i, np.newaxis]
            )
            spread[:, i] = np.einsum("kr,kra->ka", variance, np.square(np.abs(solution)))
            excess[:, i] = (w * rest).sum(axis=1) - (w * (1.0 - leverage) * scatter[:, i]).sum(1)
            sizes[:, i] = (w * (1.0 - leverage)).sum(axis=1)
        if free:
            floor = FLOOR * np.median(scatter, axis=2)
            least = NOISELESS * np.square(np.abs(y)).mean()
            estimate = smoothed(excess) / smoothed(sizes)
            distortion = np.maximum(np.maximum(estimate, floor), least)
            weights = 1.0 / (distortion[:, :, np.newaxis] + scatter)
            # Only ratios count, and the sizes stay near 1.
            weights /= weights.mean(axis=2, keepdims=True)
    return value, spread, distortion


def _check_realisations(record: MultiAxisRecord) -> None:
    """Refuse a record whose realisations cannot tell its drives apart."""
    drives, realisations = record.drives, record.realisations
    if realisations < drives:
        counted = "1 realisation" if realisations == 1 else f"{realisations} realisations"
        raise DataError(
            f"the record has {counted} for {drives} drives: expected {drives} or more, with "
            "independent phases, to tell the drives apart"
        )
    if realisations == drives and record.u.shape[3] == 1:
        raise DataError(
            f"the record has one period of {realisations} realisations for {drives} drives: "
            "expected two periods or one more realisation, which show the noise"
        )


def _check_drives(record: MultiAxisRecord, drive: Complex) -> None:
    """Refuse drives that do not repeat, or are dependent at most lines."""
    if not drive.size:
        raise DataError("the drives share no line: expected multisines on the same lines")
    u = drive.mean(axis=3)
    apart = np.square(np.abs(drive - u[..., np.newaxis])).mean()
    if apart > REPEATS**2 * np.square(np.abs(drive)).mean():
        share = 100.0 * np.sqrt(apart / np.square(np.abs(drive)).mean())
        raise DataError(
            f"the periods of the drives differ by {share:.2g} % of their rms: expected drives that "
            "repeat"
        )
    worst = float(np.median(np.linalg.cond(u)))
    if not worst < CONDITION:
        raise DataError(
            f"the {record.realisations} realisations of the drives depend on each other: expected "
            "independent phases, or orthogonal blocks"
        )


def _notes(
    record: MultiAxisRecord, y: Complex, noise: Array | None, distortion: Array | None
) -> tuple[str, ...]:
    """Warn of noisy realisations and of what the record does not show."""
    notes = []
    if noise is not None:
        power = np.square(np.abs(y)).sum(axis=(0, 1))
        share = 100.0 * np.sqrt(record.u.shape[3] * noise.sum(axis=(0, 1)) / power)
        usual = float(np.median(share))
        bad = np.flatnonzero(share > NOISY * usual)
        if bad.size:
            listed = ", ".join(f"{k} ({share[k]:.1f} %)" for k in bad)
            notes.append(
                f"realisations with more noise between their periods than the others "
                f"({usual:.1f} %), from 0: {listed}; they count less where it is"
            )
    else:
        notes.append("one period: noise and nonlinear distortion are not distinguished")
    if distortion is None:
        notes.append(
            "as many realisations as drives: the band holds noise only, not nonlinear distortion"
        )
    return tuple(notes)
