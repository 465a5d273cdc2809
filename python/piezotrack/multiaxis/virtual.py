"""`VirtualAxes`: a stage of several axes whose modes are known, and its records."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .._support.arguments import finite, in_range, not_negative, numbers
from .._support.arrays import check_dt, real_array
from ..errors import DataError, ParameterError, ShapeError
from .modal_terms import ModalTerms
from .record import MultiAxisRecord

Array = NDArray[np.float64]

__all__ = ["VirtualAxes"]

# Share of half the sampling rate that the multisines of a record fill.
FILLED = 0.88
# Largest drive [V], whose cube is a number.
LARGEST = 1e6


@dataclass(frozen=True, kw_only=True, eq=False)
class VirtualAxes:
    r"""A stage of several axes with known modes.

    .. math:: G(s) = \sum_i \frac{\omega_i^2}{s^2 + 2 \zeta_i \omega_i s + \omega_i^2} s_i d_i^T

    with a held drive; each drive may be bent, u + a u^3, which makes nonlinear distortion and a
    gain that depends on the level.

    Parameters
    ----------
    frequencies : sequence of float, shape (q,)
        Undamped frequencies [Hz].
    damping_ratios : sequence of float, shape (q,)
        Damping ratios, below 1.
    drive_shapes : array_like, shape (q, drives)
        Participation d of the drives in the modes.
    sensor_shapes : array_like, shape (q, sensors)
        Displacements s of the sensors [m/V].
    dt : float
        Sampling interval [s].
    cubic : float, optional
        Bending a of the drives [1/V^2].
    noise : float, optional
        Noise of each sensor [m rms], white.
    seed : int, optional
        Seed of the noise and of the phases of records.

    Raises
    ------
    ParameterError
        A number is out of its range.
    ShapeError
        Sizes do not fit each other.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.multiaxis.VirtualAxes.three()
    >>> (1e6 * stage.static_gain).round(1).tolist()
    [[2.2, 0.5, 0.3], [0.6, 2.1, 0.7], [0.4, 0.6, 2.2]]
    """

    frequencies: Any
    damping_ratios: Any
    drive_shapes: Any
    sensor_shapes: Any
    dt: float
    cubic: float = 0.0
    noise: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        frequencies = np.array(numbers("frequencies", self.frequencies, "Hz"))
        damping = np.array(numbers("damping_ratios", self.damping_ratios, ""))
        object.__setattr__(self, "dt", check_dt(self.dt))
        half = 0.5 / self.dt
        for frequency in frequencies:
            if not 0.0 < frequency < half:
                raise ParameterError(
                    "frequencies", f"{frequency:g} Hz", f"frequencies below {half:g} Hz, half the "
                    "sampling rate", verb="have",
                )  # fmt: skip
        for ratio in damping:
            if not 0.0 < ratio < 1.0:
                raise ParameterError("damping_ratios", ratio, "ratios between 0 and 1", verb="have")
        shapes = {}
        for name in ("drive_shapes", "sensor_shapes"):
            shapes[name] = np.array(real_array(name, getattr(self, name)))
            if shapes[name].ndim != 2 or len(shapes[name]) != frequencies.size:
                raise ShapeError(
                    name, f"the shape {shapes[name].shape}", f"{frequencies.size} rows, one a mode"
                )
        if damping.size != frequencies.size:
            raise ShapeError(
                "damping_ratios", f"{damping.size} entries", f"{frequencies.size}, one a mode"
            )
        object.__setattr__(self, "frequencies", frequencies)
        object.__setattr__(self, "damping_ratios", damping)
        for name, value in shapes.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "cubic", finite("cubic", self.cubic, "1/V^2"))
        object.__setattr__(self, "noise", not_negative("noise", self.noise, "m"))
        object.__setattr__(self, "seed", _core.as_count("seed", self.seed))

    @classmethod
    def three(cls, *, cubic: float = 0.0, noise: float = 0.0, seed: int = 0) -> VirtualAxes:
        """Make a platform on three actuators, at 2 kHz.

        Piston, two tilts, and two modes in which the actuators strain each other; the sensors
        stand between the actuators.

        Parameters
        ----------
        cubic, noise, seed
            As of the class.

        Returns
        -------
        VirtualAxes
            Three drives, three sensors, five modes from 180 to 720 Hz.
        """
        return cls(
            frequencies=[180.0, 231.0, 262.0, 540.0, 720.0],
            damping_ratios=[0.015, 0.012, 0.02, 0.01, 0.014],
            drive_shapes=[
                [1.0, 0.95, 1.0],
                [1.0, -0.45, -0.5],
                [0.1, 0.9, -0.85],
                [0.3, 0.4, -0.6],
                [-0.5, 0.6, 0.3],
            ],
            sensor_shapes=1e-6
            * np.array(
                [
                    [1.05, 1.1, 1.1],
                    [1.05, -0.5, -0.55],
                    [0.05, 0.7, -0.75],
                    [0.15, 0.2, -0.25],
                    [-0.15, 0.2, 0.1],
                ]
            ),
            dt=0.5e-3,
            cubic=cubic,
            noise=noise,
            seed=seed,
        )

    @classmethod
    def xu_li_2010(cls, *, cubic: float = 0.0, noise: float = 97e-9, seed: int = 0) -> VirtualAxes:
        """Make an XY stage like that of Xu and Li 2010, doi 10.1115/1.4001712, without hysteresis.

        A mode of 160 Hz with a damping ratio of 0.065 along each axis, 117.8 and 115 um under
        75 V, and the cross-talk of `XYStage.xu_li_2010`, at 1 kHz.

        Parameters
        ----------
        cubic, noise, seed
            As of the class; by default the noise of the paper's sensor.

        Returns
        -------
        VirtualAxes
            Two drives, two sensors, two modes.

        Examples
        --------
        >>> import piezotrack as pt
        >>> stage = pt.multiaxis.VirtualAxes.xu_li_2010()
        >>> (1e6 * stage.static_gain).round(3).tolist()
        [[1.571, 0.023], [0.016, 1.533]]
        """
        gains = np.array([117.8e-6, 115e-6]) / 75.0
        # Of each axis in the sensors of x and y.
        shares = np.array([[1.0, 0.010], [0.015, 1.0]])
        return cls(
            frequencies=[160.0, 160.0],
            damping_ratios=[0.065, 0.065],
            drive_shapes=np.eye(2),
            sensor_shapes=gains[:, np.newaxis] * shares,
            dt=1e-3,
            cubic=cubic,
            noise=noise,
            seed=seed,
        )

    @cached_property
    def terms(self) -> ModalTerms:
        """The sampled modes."""
        w = 2.0 * np.pi * self.frequencies
        damped = w * np.sqrt(1.0 - np.square(self.damping_ratios))
        poles = -self.damping_ratios * w + 1j * damped
        sampled = np.exp(poles * self.dt)
        # Partial fractions, each behind a hold.
        gain = w * w / (2j * damped) * (sampled - 1.0) / poles
        return ModalTerms(
            sampled,
            self.drive_shapes.astype(np.complex128),
            gain[:, np.newaxis] * self.sensor_shapes,
            np.zeros((self.sensor_shapes.shape[1], self.drive_shapes.shape[1])),
        ).balanced()

    @property
    def static_gain(self) -> Array:
        """Response at rest, shape (sensors, drives) [m/V]."""
        return np.asarray(self.sensor_shapes.T @ self.drive_shapes)

    def record(
        self,
        *,
        realisations: int = 6,
        periods: int = 2,
        samples: int = 1024,
        level: float = 1.0,
    ) -> MultiAxisRecord:
        """Excite the stage by orthogonal random-phase multisines, in steady state.

        Parameters
        ----------
        realisations : int, optional
            Number of realisations, orthogonal in blocks of as many as there are drives
            (Dobrowiecki, Schoukens and Guillaume 2006, doi 10.1109/TIM.2006.881571).
        periods : int, optional
            Number of periods.
        samples : int, optional
            Samples of a period, 16 or more.
        level : float, optional
            Root mean square of each drive [V].

        Returns
        -------
        MultiAxisRecord
            The record.

        Raises
        ------
        ParameterError
            An argument is out of its range.
        """
        level = in_range("level", level, LARGEST, "V")
        if level == 0.0:
            raise ParameterError("level", "0 V", "a level above 0 V")
        counts = {"realisations": realisations, "periods": periods, "samples": samples}
        for name, least in (("realisations", 1), ("periods", 1), ("samples", 16)):
            if _core.as_count(name, counts[name]) < least:
                raise ParameterError(name, counts[name], f"{least} or more")
        sensors, drives = self.terms.direct.shape
        random = np.random.default_rng(self.seed)
        lines = np.arange(1, int(FILLED * samples / 2))
        mixing = np.exp(2j * np.pi * np.outer(np.arange(drives), np.arange(drives)) / drives)
        u = np.empty((samples, drives, realisations))
        for r in range(realisations):
            if r % drives == 0:
                phases = np.exp(2j * np.pi * random.random((lines.size, drives)))
            spectrum = np.zeros((samples // 2 + 1, drives), dtype=np.complex128)
            spectrum[lines] = phases * mixing[r % drives]
            found = np.fft.irfft(spectrum, samples, axis=0)
            u[:, :, r] = level * found / np.sqrt(np.square(found).mean(axis=0))
        y = np.empty((samples, sensors, realisations, periods))
        for r in range(realisations):
            y[:, :, r] = self.simulate(u[:, :, r])[:, :, np.newaxis]
        y += self.noise * random.standard_normal(y.shape)
        return MultiAxisRecord(
            u=np.repeat(u[..., np.newaxis], periods, axis=3), y=y, dt=self.dt, source="VirtualAxes"
        )

    def simulate(self, u: Array, *, periodic: bool = True) -> Array:
        """Return the displacements without noise.

        Parameters
        ----------
        u : ndarray, shape (samples, drives)
            Drives [V].
        periodic : bool, optional
            Whether the drives repeat for ever, which they do by default; else from rest.

        Returns
        -------
        ndarray, shape (samples, sensors)
            Displacements [m].

        Raises
        ------
        ShapeError
            The drives have another number of channels.
        DataError
            A drive is not finite, or beyond 1 MV.
        """
        given = real_array("u", u)
        drives = self.terms.direct.shape[1]
        if given.ndim != 2 or given.shape[1] != drives or not len(given):
            raise ShapeError("u", f"the shape {given.shape}", f"samples x {drives} drives")
        if not np.abs(given).max() <= LARGEST:
            raise DataError(f"u: expected finite numbers up to {LARGEST:g} V")
        drive = np.ascontiguousarray(given + self.cubic * given**3)
        rest = np.zeros(self.terms.poles.size, dtype=np.complex128)
        return self.terms.simulate(drive, self.terms.steady(drive) if periodic else rest)[0]
