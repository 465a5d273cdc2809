"""Modes and delay of a measured frequency response, with their standard deviations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from .. import _core
from .._support.arguments import expect, not_negative
from .._support.display.result import Result
from .._support.files.writing import write_result
from ..errors import DataError, ParameterError
from ..stages.plays.prandtl_ishlinskii import PrandtlIshlinskiiStage
from ..stages.virtual import VirtualStage
from .response_data import FrequencyResponse

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

__all__ = ["ModalFit", "fit_modes"]

# Most modes, as many as a stage has.
MOST = 4
# Lines on each side over which the logarithm of the variance is averaged.
SMOOTH = 5
# Reduction of the criterion for each parameter, in logarithms of the count of numbers: twice that
# of Schwarz, as a mode is sought at every line.
PENALTY = 2.0
# Mean squared residual, in variances of the response, below which nothing is gained.
GAINED = 0.1
# Ends: of frequencies relative to the band, of damping ratios, and of the delay in samples.
BEYOND, DAMPED, LATEST = 2.0, 3.0, 20.0
# Least half width of a mode, in distances of the lines; starts of the delay in samples.
NARROW, DELAYS = 0.1, (0.0, 1.0, 2.0, 4.0, 8.0)
# Deviation of a response without noise, relative to its largest magnitude.
NOISELESS = 1e-9
ITERATIONS = 200


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ModalFit(Result):
    r"""Modes in parallel and a delay, fitted to a frequency response.

    .. math:: G(s) = \frac{e^{-s \tau}}{1 + s / \omega_a}
        \sum_i \frac{g_i \omega_i^2}{s^2 + 2 \zeta_i \omega_i s + \omega_i^2}

    sampled with a held drive, the lag of an amplifier where the response shows one. Standard
    deviations follow from the variance of the response, and are larger by the misfit where the
    modes do not describe it.

    Attributes
    ----------
    response : FrequencyResponse
        The response.
    gains : ndarray, shape (n,)
        Static gains g of the modes, the largest in magnitude first [m/V].
    frequencies, damping_ratios : ndarray, shape (n,)
        Undamped frequencies [Hz], and damping ratios.
    bandwidth : float
        Bandwidth of the amplifier [Hz]; infinite where the response shows no lag.
    delay : float
        Delay besides the hold [s].
    frequencies_sd, damping_ratios_sd : ndarray, shape (n,)
        Standard deviations of these.
    delay_sd : float
        Standard deviation of the delay [s]; 0 where it was given.
    misfit : float
        Root mean square residual in standard deviations of the response; 1 where the modes
        describe it.
    fitted : ndarray of complex, shape (m,)
        Sampled response of the modes at the lines [m/V].
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "response.views.modal_text:modal_text",
        "plot": "response.views.response_plot:plot_modal_fit",
    }

    response: FrequencyResponse
    gains: Array
    frequencies: Array
    damping_ratios: Array
    bandwidth: float
    delay: float
    frequencies_sd: Array
    damping_ratios_sd: Array
    delay_sd: float
    misfit: float
    fitted: Complex

    def __repr__(self) -> str:
        listed = ", ".join(
            f"{f:.4g} Hz ({z:.3g})"
            for f, z in zip(self.frequencies, self.damping_ratios, strict=True)
        )
        return f"<ModalFit: {listed}, delay {1e6 * self.delay:.4g} us>"

    @property
    def gain(self) -> float:
        """Static gain, the sum of those of the modes [m/V]."""
        return float(self.gains.sum())

    @property
    def dynamics(self) -> dict[str, Any]:
        """The modes as parameters of a stage whose hysteresis is at the input.

        ``dataclasses.replace(stage, **fit.dynamics)`` gives it to one that a slow log identified.
        """
        beside = {
            "mode_weights": self.gains / self.gain,
            "mode_frequencies": self.frequencies,
            "mode_damping_ratios": self.damping_ratios,
        }
        return {
            "frequency": float(self.frequencies[0]),
            "damping_ratio": float(self.damping_ratios[0]),
            **{name: tuple(values[1:].tolist()) for name, values in beside.items()},
        }

    @cached_property
    def stage(self) -> VirtualStage:
        """A stage without hysteresis that has these modes and this delay.

        For `check_loop`, `tune` and simulations of small motions.
        """
        model = PrandtlIshlinskiiStage(linear=self.gain, thresholds=(), weights=(), **self.dynamics)
        return VirtualStage.of(model, delay=self.delay, bandwidth=self.bandwidth)

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {
            "format": "piezotrack-modes",
            "schema_version": 1,
            "gains_m_per_V": self.gains.tolist(),
            "frequencies_Hz": self.frequencies.tolist(),
            "frequencies_sd_Hz": self.frequencies_sd.tolist(),
            "damping_ratios": self.damping_ratios.tolist(),
            "damping_ratios_sd": self.damping_ratios_sd.tolist(),
            "bandwidth_Hz": self.bandwidth if np.isfinite(self.bandwidth) else None,
            "delay_s": self.delay,
            "delay_sd_s": self.delay_sd,
            "misfit": self.misfit,
            "provenance": {"package": "piezotrack", "version": _core.__version__},
        }

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write modes and picture to a folder, in one go.

        Parameters
        ----------
        folder : path-like
            It is made where it does not exist.

        Returns
        -------
        list of pathlib.Path
            ``modes.csv`` with the fitted response, ``modes.json``, ``modes.png`` and ``.svg``.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        table = {
            "frequency_Hz": self.response.frequency,
            "real_m_per_V": self.fitted.real,
            "imaginary_m_per_V": self.fitted.imag,
        }
        return write_result(folder, "modes", self.document(), self.plot(), table)


def fit_modes(
    response: FrequencyResponse, *, modes: int | None = None, delay: float | None = None
) -> ModalFit:
    """Fit modes in parallel and a delay to a frequency response, by weighted least squares.

    Parameters
    ----------
    response : FrequencyResponse
        The response.
    modes : int, optional
        Number of modes, 1 to 4; by default the one that the criterion of Schwarz (1978, doi
        10.1214/aos/1176344136) chooses, with twice its penalty.
    delay : float, optional
        Delay besides the hold [s]; fitted by default.

    Returns
    -------
    ModalFit
        The modes, and a stage that has them.

    Raises
    ------
    ParameterError
        An argument is out of its range.
    DataError
        There are fewer lines than unknowns, or no modes describe the response.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=(), weights=(), frequency=160.0, damping_ratio=0.02
    ... )
    >>> lines = pt.RandomPhaseMultisine(band=(8.0, 800.0), low=28.0, high=32.0)
    >>> response = pt.frequency_response(pt.VirtualStage.of(stage, noise=5e-9), lines, rate=2000.0)
    >>> fit = pt.fit_modes(response)
    >>> f"{fit.frequencies[0]:.1f} Hz, {fit.damping_ratios[0]:.3f}, {1e6 * fit.gain:.2f} um/V"
    '160.0 Hz, 0.020, 1.00 um/V'
    """
    expect("response", response, FrequencyResponse, "pt.FrequencyResponse")
    if modes is not None and not 1 <= _core.as_count("modes", modes) <= MOST:
        raise ParameterError("modes", modes, f"1 to {MOST}")
    if delay is not None:
        delay = not_negative("delay", delay, "s")
    most = MOST if modes is None else modes
    if 2 * response.frequency.size <= 3 * most + 1:
        raise DataError(
            f"the response has {response.frequency.size} lines: expected more than "
            f"{(3 * most + 1) // 2} for {most} modes"
        )
    problem = _Problem(response, delay)
    count = 2 * response.frequency.size
    best, lowest = None, np.inf
    for lagging in (False, True):
        start: _Unknowns | None = None
        for number in range(1, most + 1):
            start = problem.descend(problem.with_a_mode(start, lagging=lagging))
            criterion = count * np.log(2.0 * start.cost / count + GAINED)
            criterion += PENALTY * start.values.size * np.log(count)
            wanted = number == modes if modes is not None else problem.is_stage(start)
            if wanted and criterion < lowest:
                best, lowest = start, criterion
    if best is None:
        raise DataError("no mode describes the response: expected one that falls off at its end")
    return problem.result(best)


@dataclass(frozen=True)
class _Unknowns:
    """Logarithms of frequencies, damping ratios and corner, and the delay, in an array.

    Attributes
    ----------
    values : ndarray, shape (2 n + 0 to 2,)
        The array.
    modes : int
        Number n of modes.
    lagging : bool
        Whether it has a corner frequency.
    cost : float
        Half the sum of squared residuals.
    jacobian : ndarray, shape (m, values)
        Derivatives of the residuals.
    """

    values: Array
    modes: int
    lagging: bool
    cost: float
    jacobian: Array


class _Problem:
    """Weighted residual of a response over frequencies, damping ratios, corner and delay.

    The gains, in which the response is linear, follow from these (variable projection: Golub and
    Pereyra 1973, doi 10.1137/0710036).
    """

    def __init__(self, response: FrequencyResponse, delay: float | None) -> None:
        self.response, self.delay = response, delay
        deviation = np.sqrt(0.5 * _smoothed(response.variance))
        # A response without noise has no scale of its own.
        self.deviation = np.maximum(deviation, NOISELESS * response.magnitude.max())
        f = response.frequency
        self.band = float(f[0]), float(f[-1])
        self.spacing = (self.band[1] - self.band[0]) / (f.size - 1)

    def unpack(self, x: Array, modes: int, *, lagging: bool) -> tuple[Array, Array, float, float]:
        """Return frequencies [Hz], damping ratios, corner [Hz] and delay [samples]."""
        late = self.delay / self.response.dt if self.delay is not None else float(x[-1])
        corner = float(np.exp(x[2 * modes])) if lagging else np.inf
        return np.exp(x[:modes]), np.exp(x[modes : 2 * modes]), corner, late

    def gains(self, shapes: Complex) -> Array:
        """Return the gains that fit best."""
        weighted = _stacked(shapes / self.deviation[:, np.newaxis])
        target = _stacked(self.response.value / self.deviation)
        return np.asarray(np.linalg.lstsq(weighted, target, rcond=None)[0])

    def is_stage(self, found: _Unknowns) -> bool:
        """Whether no mode beside the main one has more than the static gain of all."""
        gains = self.gains(self.shapes(found.values, found.modes, lagging=found.lagging))
        beside = np.sort(np.abs(gains))[:-1]
        return bool((beside < abs(gains.sum())).all())

    def shapes(self, x: Array, modes: int, *, lagging: bool) -> Complex:
        """Return the sampled response of each mode of gain 1, with lag and delay."""
        frequency, damping, corner, late = self.unpack(x, modes, lagging=lagging)
        dt = self.response.dt
        z = np.exp(2j * np.pi * self.response.frequency * dt)
        whole = np.floor(late)

        def held(pole: complex, residue: complex) -> Complex:
            """Return residue/(s - pole) behind a hold and the rest of the delay."""
            full, part = np.exp(pole * dt), np.exp(pole * (1.0 - (late - whole)) * dt)
            found = residue / pole * ((part - 1.0) + (full - part) / z) / (z - full)
            return np.asarray(found)

        columns = []
        lag = -2.0 * np.pi * corner
        for f, zeta in zip(frequency, damping, strict=True):
            w = 2.0 * np.pi * f
            # Two poles apart, also where they would meet.
            root = np.sqrt(complex(zeta * zeta - 1.0) or 1e-12)
            column = np.zeros(z.size, dtype=np.complex128)
            for pole, sign in ((w * (-zeta + root), 1.0), (w * (-zeta - root), -1.0)):
                residue = sign * w / (2.0 * root)
                column += held(pole, residue if not lagging else residue * lag / (lag - pole))
            if lagging:
                column += held(lag, -lag * w * w / (lag * lag + 2.0 * zeta * w * lag + w * w))
            columns.append(column / z**whole)
        return np.stack(columns, axis=1)

    def residual(self, x: Array, modes: int, *, lagging: bool) -> Array:
        """Return the residual in standard deviations, real and imaginary parts."""
        shapes = self.shapes(x, modes, lagging=lagging)
        error = self.response.value - shapes @ self.gains(shapes)
        return _stacked(error / self.deviation)

    def with_a_mode(self, before: _Unknowns | None, *, lagging: bool) -> _Unknowns:
        """Return a start with one more mode: the best of some frequencies and damping ratios."""
        number = 0 if before is None else before.modes
        others = np.empty(0) if before is None else before.values[: 2 * number]
        if before is not None:
            rests = [before.values[2 * number :]]
        else:
            corners = [[np.log(c)] for c in np.geomspace(*self.band, 7)[1::2]] if lagging else [[]]
            delays = [[one] for one in DELAYS] if self.delay is None else [[]]
            rests = [np.array([*corner, *late]) for corner in corners for late in delays]
        trials = []
        for f in np.geomspace(self.band[0], 1.5 * self.band[1], 60):
            for zeta in (0.01, 0.05, 0.3, 1.0):
                new = np.insert(others, [number, 2 * number], np.log([f, zeta]))
                for rest in rests:
                    trial = np.concatenate([new, rest])
                    error = self.residual(trial, number + 1, lagging=lagging)
                    trials.append((0.5 * float(error @ error), trial))
        cost, values = min(trials, key=lambda one: one[0])
        return _Unknowns(values, number + 1, lagging, cost, np.empty((0, 0)))

    def descend(self, start: _Unknowns) -> _Unknowns:
        """Minimise the residual from a start."""
        from scipy.optimize import least_squares

        n, values = start.modes, start.values
        least, most = np.full(values.size, -np.inf), np.full(values.size, np.inf)
        ends = np.log([self.band[0] / BEYOND, self.band[1] * BEYOND])
        least[:n], most[:n] = ends
        # A mode narrower than the lines fits the noise of one.
        least[n : 2 * n] = np.log(np.maximum(NARROW * self.spacing / np.exp(values[:n]), 1e-5))
        most[n : 2 * n] = np.log(DAMPED)
        if start.lagging:
            least[2 * n], most[2 * n] = ends
        if self.delay is None:
            least[-1], most[-1] = 0.0, LATEST
        found = least_squares(
            lambda x: self.residual(x, n, lagging=start.lagging),
            np.clip(values, least + 1e-9, most - 1e-9),
            bounds=(least, most),
            x_scale="jac",
            max_nfev=ITERATIONS,
        )
        return _Unknowns(found.x, n, start.lagging, float(found.cost), found.jac)

    def result(self, found: _Unknowns) -> ModalFit:
        """Return the fit with standard deviations, the mode of the largest gain first."""
        response, n = self.response, found.modes
        frequency, damping, corner, late = self.unpack(found.values, n, lagging=found.lagging)
        shapes = self.shapes(found.values, n, lagging=found.lagging)
        gains = self.gains(shapes)
        order = np.argsort(-np.abs(gains))
        free = max(1, 2 * response.frequency.size - found.values.size - n)
        misfit = float(np.sqrt(2.0 * found.cost / free))
        covariance = np.linalg.pinv(found.jacobian.T @ found.jacobian) * max(1.0, misfit) ** 2
        deviation = np.sqrt(np.diag(covariance))
        return ModalFit(
            response=response,
            gains=gains[order],
            frequencies=frequency[order],
            damping_ratios=damping[order],
            bandwidth=corner,
            delay=late * response.dt,
            frequencies_sd=(frequency * deviation[:n])[order],
            damping_ratios_sd=(damping * deviation[n : 2 * n])[order],
            delay_sd=float(deviation[-1]) * response.dt if self.delay is None else 0.0,
            misfit=misfit,
            fitted=shapes @ gains,
        )


def _stacked(values: Complex) -> Array:
    """Return real parts above imaginary parts."""
    return np.concatenate([values.real, values.imag])


def _smoothed(variance: Array) -> Array:
    """Average the logarithm of a variance over neighbours, since a few draws gave each."""
    logarithm = np.log(np.maximum(variance, variance.max() * 1e-12 + 1e-300))
    padded = np.pad(logarithm, SMOOTH, mode="edge")
    return np.asarray(
        np.exp(np.convolve(padded, np.full(2 * SMOOTH + 1, 1 / (2 * SMOOTH + 1)), "valid"))
    )
