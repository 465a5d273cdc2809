"""`MultiAxisModel`: modes of several axes at one level or several, with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from .. import _core
from .._support.arguments import expect, one_of, positive
from .._support.arrays import real_array
from .._support.display.result import Result
from .._support.files.writing import write_result
from .._support.messages import quoted
from ..errors import DataError, ParameterError, ShapeError
from .distortion import Distortion, simulate_distorted
from .record import MultiAxisRecord, check_skip, relative_error

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from .approximation import MultiAxisResponse
    from .modal_terms import ModalTerms

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

__all__ = ["FORMAT", "SCHEMA_VERSION", "AxesLevel", "MultiAxisModel", "MultiAxisMotion"]

FORMAT, SCHEMA_VERSION = "piezotrack-axes", 1
STARTS = ("rest", "periodic")


class MultiAxisMotion(NamedTuple):
    """Simulated motion of several axes.

    Attributes
    ----------
    y : ndarray, shape (samples, sensors)
        Displacements [m].
    state : ndarray of complex, shape (modes,)
        State after the last sample, from which a simulation at the same level goes on.
    """

    y: Array
    state: Complex


@dataclass(frozen=True, kw_only=True, eq=False)
class AxesLevel:
    """Modes at one level of the drives.

    Attributes
    ----------
    level : float
        Root mean square of the drives about their means [V].
    terms : ModalTerms
        The modes; mode i of every level is the same one.
    decay_sd, angle_sd : ndarray, shape (modes,)
        Standard deviations of the logarithms of the decays of the poles, and of their angles [rad].
    misfit : float
        Rms error of the modes on the measured response, relative to the response.
    expected : float
        The same as noise and distortion make it expected.
    drive_mean, output_mean : ndarray, shape (drives,) and (sensors,)
        Operating point [V] and [m].
    distorted : float
        Rms of what modes and distortion leave of the record, relative to what the modes leave.
    """

    level: float
    terms: ModalTerms
    decay_sd: Array
    angle_sd: Array
    misfit: float
    expected: float
    drive_mean: Array
    output_mean: Array
    distorted: float = 1.0


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MultiAxisModel(Result):
    r"""Modes of several axes that share their poles, at one level or several.

    .. math:: G(z) = D + \sum_i \frac{c_i b_i^T}{z - p_i} + \frac{\bar c_i \bar b_i^T}
        {z - \bar p_i}

    sampled with a held drive, stable. Between two levels logarithms of poles, b, c and D are
    interpolated linearly in the square root of the level, the root mean square of the drives;
    below the least level and above the largest they are those of that level. A term that is
    strongly damped or has another shape at both levels is no mode that moved: it is taken from
    both, by their shares. Nonlinear functions of the drives and of the linear motion act on the
    modes beside; their distortion has no part that is linear in the drives, and responses, gains
    and modes are those of the best linear approximation.

    Attributes
    ----------
    levels : tuple of AxesLevel
        The modes at each level, rising.
    dt : float
        Sampling interval [s].
    drive_unit, output_unit : str
        Units of the drives and of what the sensors read.
    distortion : Distortion
        Nonlinear functions that act on the modes; empty where the records show none.
    responses : tuple of MultiAxisResponse
        The measured responses; none where the model was read from a file.
    source : str or None
        Description of the record.
    notes : tuple of str
        Warnings, one sentence each.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "multiaxis.views.model_text:model_text",
        "plot": "multiaxis.views.model_plot:plot_model",
    }

    levels: tuple[AxesLevel, ...]
    dt: float
    drive_unit: str = "V"
    output_unit: str = "m"
    distortion: Distortion = field(default_factory=Distortion)
    responses: tuple[MultiAxisResponse, ...] = ()
    source: str | None = None
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        listed = ", ".join(f"{one.level:.3g}" for one in self.levels)
        return (
            f"<MultiAxisModel: {self.sensors} x {self.drives}, {self.states} states, levels of "
            f"{listed} {self.drive_unit} rms>"
        )

    @property
    def drives(self) -> int:
        """Number of drives."""
        return int(self.levels[0].terms.direct.shape[1])

    @property
    def sensors(self) -> int:
        """Number of sensors."""
        return int(self.levels[0].terms.direct.shape[0])

    @property
    def states(self) -> int:
        """Number of states, two for each mode."""
        return 2 * int(self.levels[0].terms.poles.size)

    def at(self, level: float | None = None) -> ModalTerms:
        """Return the modes at a level of the drives.

        Parameters
        ----------
        level : float, optional
            Root mean square of the drives about their means [V]; by default the middle one of
            those that were measured.

        Returns
        -------
        ModalTerms
            The modes, interpolated, with all forces of the distortion.

        Raises
        ------
        ParameterError
            `level` is not above 0.
        """
        lower, upper, share = self._place(level)
        size = lower.level if level is None else level
        first, second = (self.distortion.on(one.terms, size) for one in (lower, upper))
        return first if share == 0.0 else first.between(second, share)

    def response(self, frequency: ArrayLike, *, level: float | None = None) -> Complex:
        """Return the frequency responses.

        Parameters
        ----------
        frequency : array_like, shape (k,)
            Frequencies [Hz], up to half the sampling rate.
        level : float, optional
            As of `at`.

        Returns
        -------
        ndarray of complex, shape (k, sensors, drives)
            Responses [m/V].
        """
        frequencies = np.atleast_1d(real_array("frequency", frequency))
        if frequencies.ndim != 1 or not (np.abs(frequencies) < _core.LARGEST).all():
            raise ParameterError("frequency", quoted(frequency), "a row of frequencies")
        return self.at(level).response(np.exp(2j * np.pi * frequencies * self.dt))

    def static_gain(self, *, level: float | None = None) -> Array:
        """Return the responses at rest, beyond the lowest line extrapolated.

        Parameters
        ----------
        level : float, optional
            As of `at`.

        Returns
        -------
        ndarray, shape (sensors, drives)
            Gains [m/V].
        """
        return np.asarray(self.response([0.0], level=level)[0].real)

    def frequencies(self, *, level: float | None = None) -> Array:
        """Return the undamped frequencies of the modes [Hz]; parameters as of `at`."""
        return np.asarray(np.abs(np.log(self.at(level).poles)) / (2.0 * np.pi * self.dt))

    def damping_ratios(self, *, level: float | None = None) -> Array:
        """Return the damping ratios of the modes; parameters as of `at`."""
        logarithm = np.log(self.at(level).poles)
        return np.asarray(-logarithm.real / np.abs(logarithm))

    def simulate(
        self,
        u: ArrayLike,
        *,
        level: float | None = None,
        start: str | ArrayLike = "rest",
    ) -> MultiAxisMotion:
        """Simulate the motion under any drives.

        Parameters
        ----------
        u : array_like, shape (samples, drives)
            Drives [V], sampled at `dt`.
        level : float, optional
            Root mean square of the drives [V] at which the modes are taken; by default that of
            `u` about its means.
        start : {"rest", "periodic"} or array_like of complex, shape (modes,), optional
            The state before the first sample: at rest at the operating point, that of drives
            that repeat for ever, or one that a simulation ended with.

        Returns
        -------
        MultiAxisMotion
            Displacements and the last state.

        Raises
        ------
        ShapeError
            The drives have another number of channels, or the state another number of modes.
        DataError
            A sample is not finite.
        ParameterError
            An argument is out of its range.
        """
        drive = real_array("u", u)
        if drive.ndim != 2 or drive.shape[1] != self.drives or not len(drive):
            raise ShapeError("u", f"the shape {drive.shape}", f"samples x {self.drives} drives")
        if not np.isfinite(drive).all():
            place = tuple(int(k) for k in np.argwhere(~np.isfinite(drive))[0])
            raise DataError(f"u{list(place)} is {drive[place]}: expected finite numbers only")
        if level is None:
            # Drives that stand still have no level.
            level = level_of(drive) or None
        lower, upper, share = self._place(level)
        terms = self.at(level)
        about = (1.0 - share) * lower.drive_mean + share * upper.drive_mean
        offset = (1.0 - share) * lower.output_mean + share * upper.output_mean
        moved = np.ascontiguousarray(drive - about)
        modes, memory = terms.poles.size, 0
        if self.distortion:
            memory = modes + 2 * self.drives + len(self.distortion.regressors)
        if isinstance(start, str):
            one_of("start", start, STARTS)
            state = np.zeros(modes + memory, dtype=np.complex128)
            if start == "periodic" and not self.distortion:
                state = terms.steady(moved)
        else:
            try:
                state = np.asarray(start, dtype=np.complex128)
            except (TypeError, ValueError, OverflowError):
                raise ParameterError(
                    "start", quoted(start), "'rest', 'periodic' or a state"
                ) from None
            if state.shape != (modes + memory,):
                raise ShapeError("start", f"the shape {state.shape}", f"{modes + memory} entries")
        if not self.distortion:
            y, last = terms.simulate(moved, state)
            return MultiAxisMotion(y + offset, last)
        size = lower.level if level is None else level
        periodic = isinstance(start, str) and start == "periodic"
        y, last = simulate_distorted(terms, self.distortion, size, moved, state, periodic=periodic)
        return MultiAxisMotion(y + offset, last)

    def score(self, record: MultiAxisRecord, *, skip: int = 100, start: str = "periodic") -> Array:
        """Compare the simulation of a record with its displacements.

        Parameters
        ----------
        record : MultiAxisRecord
            A record of these drives and sensors; the modes are those at the level of each
            realisation.
        skip : int, optional
            Samples left out at the start of each period, or of the whole where it is from rest.
        start : {"periodic", "rest"}, optional
            Whether each period is in steady state, or all of them follow each other from rest.

        Returns
        -------
        ndarray, shape (realisations,)
            Rms error over all sensors, relative to the rms of the displacements about their
            means.

        Raises
        ------
        ParameterError
            The record has another interval, or `skip` leaves nothing.
        ShapeError
            The record has other numbers of drives or sensors.
        """
        expect("record", record, MultiAxisRecord, "a MultiAxisRecord")
        one_of("start", start, STARTS)
        self._check_fits(record)
        check_skip(skip, record.samples)
        found = []
        for r in range(record.realisations):
            u, y = (np.moveaxis(one[:, :, r], 2, 0) for one in (record.u, record.y))
            if start == "rest":
                # All periods after each other.
                u, y = (one.reshape(1, -1, one.shape[2]) for one in (u, y))
            still = y.mean(axis=(0, 1))
            errors = []
            for drive, measured in zip(u, y, strict=True):
                level = level_of(np.concatenate(list(u)))
                simulated = self.simulate(drive, level=level, start=start).y
                errors.append(relative_error(measured - still, simulated - still, skip))
            found.append(float(np.sqrt(np.mean(np.square(errors)))))
        return np.array(found)

    def document(self) -> dict[str, Any]:
        """Content of the JSON file, which `load_axes` reads.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "drive_unit": self.drive_unit,
            "output_unit": self.output_unit,
            "dt_s": self.dt,
            "levels": [_level_document(one) for one in self.levels],
            "distortion": _distortion_document(self.distortion),
            "source": self.source,
            "notes": list(self.notes),
            "provenance": {"package": "piezotrack", "version": _core.__version__},
        }

    @property
    def table(self) -> dict[str, Array]:
        """Columns of the modes: frequencies and damping ratios at each level."""
        columns: dict[str, Array] = {"mode": np.arange(self.states // 2, dtype=np.float64)}
        for one in self.levels:
            name = f"{one.level:.4g}_{self.drive_unit}"
            columns[f"frequency_Hz_at_{name}"] = self.frequencies(level=one.level)
            columns[f"damping_ratio_at_{name}"] = self.damping_ratios(level=one.level)
        return columns

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the model to a folder, in one go.

        Parameters
        ----------
        folder : path-like
            It is made where it does not exist.

        Returns
        -------
        list of pathlib.Path
            ``axes.csv`` with the modes, ``axes.json``, ``axes.png`` and ``.svg``.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        return write_result(folder, "axes", self.document(), self.plot(), self.table)

    def _place(self, level: float | None) -> tuple[AxesLevel, AxesLevel, float]:
        """Return the levels beside one, and the share of the way between them."""
        if level is None:
            middle = self.levels[len(self.levels) // 2]
            return middle, middle, 0.0
        known = np.sqrt([one.level for one in self.levels])
        wanted = float(np.clip(np.sqrt(positive("level", level, "V")), known[0], known[-1]))
        k = min(max(int(np.searchsorted(known, wanted)) - 1, 0), max(len(known) - 2, 0))
        lower, upper = self.levels[k], self.levels[min(k + 1, len(known) - 1)]
        if lower is upper:
            return lower, upper, 0.0
        share = float((wanted - known[k]) / (known[k + 1] - known[k]))
        return (upper, upper, 0.0) if share == 1.0 else (lower, upper, share)

    def _check_fits(self, record: MultiAxisRecord) -> None:
        """Refuse a record of another interval or of other channels."""
        if abs(record.dt - self.dt) > 1e-6 * self.dt:
            raise ParameterError(
                "record", f"{1.0 / record.dt:.6g} Hz", f"{1.0 / self.dt:.6g} Hz, as the model",
                verb="has",
            )  # fmt: skip
        for words, mine, theirs in (
            ("drives", record.drives, self.drives),
            ("sensors", record.sensors, self.sensors),
        ):
            if mine != theirs:
                raise ShapeError("record", f"{mine} {words}", f"{theirs}, as the model")


def level_of(drive: Array) -> float:
    """Return the root mean square of drives about their means, shape (samples, drives)."""
    return float(np.sqrt(np.mean(np.square(drive - drive.mean(axis=0)))))


def _distortion_document(distortion: Distortion) -> dict[str, Any]:
    regressors = distortion.regressors
    return {
        "products": [list(one) for one in regressors.products],
        "stops": [list(one) for one in regressors.stops],
        "changes": [list(one) for one in regressors.changes],
        "reference_rms": distortion.reference,
        "forces": [
            [one.mode, one.regressor, one.power, one.value.real, one.value.imag]
            for one in distortion.forces
        ],
    }


def _level_document(one: AxesLevel) -> dict[str, Any]:
    terms = one.terms
    parts = {
        f"{name}_{part}": getattr(getattr(terms, name), short).tolist()
        for name in ("poles", "inputs", "outputs", "forces")
        for part, short in (("real", "real"), ("imaginary", "imag"))
    }
    return {
        "level_rms": one.level,
        **parts,
        "direct": terms.direct.tolist(),
        "decay_sd": one.decay_sd.tolist(),
        "angle_sd_rad": one.angle_sd.tolist(),
        "misfit": one.misfit,
        "expected_misfit": one.expected,
        "drive_mean": one.drive_mean.tolist(),
        "output_mean": one.output_mean.tolist(),
        "distorted": one.distorted,
    }
