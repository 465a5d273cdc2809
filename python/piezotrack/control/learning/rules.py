"""Updates of iterative learning control, and whether they converge on a set of models."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np

from ... import _core
from ..._support.arrays import signal_of
from ...errors import ParameterError, ShapeError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from .plants import LearningPlant

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

__all__ = ["Convergence", "FrequencyRule", "LiftedRule", "Rule", "frequency_rule", "lifted_rule"]

# Order of the low-pass Q: 6 halves the band between passing 0.9 and passing 0.1.
ORDER = 3
# Where a cutoff or a weight is chosen, this share of an error may remain after a trial.
TARGET = 0.9
# Standard deviations of the noise beyond which an error at a harmonic has grown; shares of the
# cutoff between which that lowers it, to the first at least; share of it that a trial then leaves.
CERTAIN, LEAST_SHARE, MOST_SHARE, AFTER_GROWTH = 4.0, 0.1, 2.0, 0.5
# Nothing is learnt at frequencies where the feedback leaves less than this of the largest response.
NOTHING = 1e-5
# Longest trial of the lifted form [samples]: its matrices grow with the square of it.
LONGEST_LIFTED = 2000
# Steps of the search for a largest singular value: it ends where the square, which is found from
# below, has grown by this part in a few.
MOST_STEPS, FEW_STEPS, GROWTH = 200, 8, 1e-5
# Cutoffs of the lifted form, in parts of the sampling rate: below them its equations are ill
# conditioned, and none is above half of it.
LOWEST_EDGE, HIGHEST_EDGE = 0.002, 0.5
# The highest that is chosen, in the same parts: beyond it a sample more or less is half a turn.
HIGHEST_CHOSEN = 0.25


@dataclass(frozen=True, kw_only=True)
class Convergence:
    """Share of the distance to the final table that remains after a trial.

    Attributes
    ----------
    factor : float
        The largest share over models and frequencies; the distance falls monotonically, from the
        first trial on, where it is below 1.
    model : str
        The model of that share.
    frequency : float
        Its frequency [Hz].
    cases : tuple of (str, float, float)
        The same of each model: name, share, frequency [Hz].
    """

    factor: float
    model: str
    frequency: float
    cases: tuple[tuple[str, float, float], ...]

    @property
    def monotone(self) -> bool:
        """Whether the distance falls on every model."""
        return self.factor < 1.0

    def __str__(self) -> str:
        words = "slowest convergence" if self.monotone else "DIVERGENCE"
        return (
            f"{words}: factor {self.factor:#.3g} a trial, at {self.frequency:.3g} Hz on "
            f"{self.model}; {len(self.cases)} models"
        )

    @classmethod
    def _worst(cls, cases: Sequence[tuple[str, float, float]]) -> Convergence:
        name, factor, frequency = max(cases, key=lambda one: one[1])
        return cls(factor=factor, model=name, frequency=frequency, cases=tuple(cases))


class Rule(Protocol):
    """An update between trials."""

    @property
    def convergence(self) -> Convergence:
        """On the models that it was made for."""
        ...

    @property
    def cutoff(self) -> float:
        """Frequency at which Q is a half [Hz]."""
        ...

    def after(self, learnt: Array, error: Array) -> Array:
        """Return the next learnt voltage [V] from the last one and its error [m]."""
        ...


R = TypeVar("R", bound=Rule)


def _trial(learnt: ArrayLike, error: ArrayLike, samples: int) -> tuple[Array, Array]:
    """Check a trial: as many voltages [V] and errors [m] as it has samples, all finite."""
    trial = signal_of("learnt", learnt), signal_of("error", error)
    for name, values in zip(("learnt", "error"), trial, strict=True):
        if values.size != samples:
            raise ShapeError(name, f"{values.size} samples", f"{samples}, as a trial")
    return trial


@dataclass(frozen=True, kw_only=True, eq=False)
class FrequencyRule:
    r"""Update in the frequency domain, of a trial that is one settled period.

    .. math:: U_{j+1} = Q (\varphi U_j + \gamma \hat G^{-1} E_j)

    Attributes
    ----------
    frequency : ndarray, shape (m,)
        Harmonics of the period, from 0 on [Hz].
    learning : ndarray of complex, shape (m,)
        Learning filter, gain and inverse of the model [V/m].
    forgetting_factor : float
        Share of what was learnt that is kept.
    cutoff : float
        Frequency at which Q is a half [Hz].
    samples : int
        Samples of the period.
    shares : tuple of (str, ndarray)
        Share of the distance to the final table that a trial leaves without Q, of each model.
    """

    frequency: Array
    learning: Complex
    forgetting_factor: float
    cutoff: float
    samples: int
    shares: tuple[tuple[str, Array], ...]

    @cached_property
    def smoothing(self) -> Array:
        """Q at the harmonics, shape (m,); without phase, and 0 where nothing is learnt."""
        low_pass = 1.0 / (1.0 + (self.frequency / self.cutoff) ** (2 * ORDER))
        return np.where(self.learning != 0.0, low_pass, 0.0)

    @cached_property
    def convergence(self) -> Convergence:
        """Share of the distance to the final table that remains after a trial, by model."""
        cases = []
        for name, share in self.shares:
            remains = self.smoothing * share
            k = int(np.argmax(remains))
            cases.append((name, float(remains[k]), float(self.frequency[k])))
        return Convergence._worst(cases)

    def after(self, learnt: Array, error: Array) -> Array:
        """Return the next learnt voltage from the last one and its error.

        Parameters
        ----------
        learnt : ndarray, shape (n,)
            Voltage of the last trial above the feedforward [V].
        error : ndarray, shape (n,)
            Desired less measured displacement [m].

        Returns
        -------
        ndarray, shape (n,)
            For the next trial [V], before the limits.

        Raises
        ------
        ShapeError, DataError
            `learnt` or `error` is no trial of this length, or not finite.
        """
        learnt, error = _trial(learnt, error, self.samples)
        before, wrong = np.fft.rfft(learnt), np.fft.rfft(error)
        return np.fft.irfft(
            self.smoothing * (self.forgetting_factor * before + self.learning * wrong), self.samples
        )

    def cutoff_below_growth(
        self, before: tuple[Array, Array], after: Array, noise: float
    ) -> float | None:
        """Return the cutoff with which the errors that grew at harmonics fall; None where none did.

        Above a tenth of the cutoff a model may lack a mode: at each harmonic whose error grew
        beyond the noise, Q times the growth without Q comes to `AFTER_GROWTH`.

        Parameters
        ----------
        before : (ndarray, ndarray), each of shape (n,)
            Errors of the first trial and of the best so far [m]; what is not learnt is that of the
            first.
        after : ndarray, shape (n,)
            Error of a later trial [m].
        noise : float
            Rms of what does not repeat in each [m].

        Returns
        -------
        float or None
            Below the present one [Hz].
        """
        small, large = np.abs(np.fft.rfft(before)).max(axis=0), np.abs(np.fft.rfft(after))
        floor = np.sqrt(self.samples) * noise
        places = self.frequency / self.cutoff
        grown = (large > small + CERTAIN * np.sqrt(2.0) * floor) & (self.smoothing > 0.0)
        grown &= (places > LEAST_SHARE) & (places < MOST_SHARE)
        # Hysteresis moves errors between harmonics: most of what is left has to have grown.
        if np.sum(large[grown] ** 2) <= 0.5 * np.sum(large**2):
            return None
        # What Q has left of the growth is in the errors.
        ratio = large[grown] / np.maximum(small[grown], max(floor, 1e-15 * large.max()))
        beyond = ratio / self.smoothing[grown] / AFTER_GROWTH - 1.0
        edge = float((self.frequency[grown] / beyond ** (0.5 / ORDER)).min())
        return max(edge, LEAST_SHARE * self.cutoff) if edge < self.cutoff else None

    def taps(self, half: int) -> tuple[Array, Array]:
        """Return filters without FFT, as the crate's `IterativeLearning` takes them.

        Parameters
        ----------
        half : int
            Taps on each side of the middle one.

        Returns
        -------
        learning : ndarray, shape (2 half + 1,)
            From the error to the voltage [V/m], Q in it; the middle one is of the same sample.
        smoothing : ndarray, shape (2 half + 1,)
            Symmetric.
        """
        half = _core.as_count("half", half)
        if not 1 <= half <= (self.samples - 1) // 2:
            raise ParameterError(
                "half", half, f"1 to {(self.samples - 1) // 2}, less than half a period"
            )
        window = np.cos(0.5 * np.pi * np.arange(-half, half + 1) / (half + 1)) ** 2
        filters = (self.smoothing * self.learning, self.smoothing * self.forgetting_factor)
        wanted = (np.fft.irfft(one, self.samples) for one in filters)
        learning, smoothing = (
            window * np.concatenate([one[-half:], one[: half + 1]]) for one in wanted
        )
        # The window took from a constant too, of which Q must keep what it kept.
        smoothing *= float(filters[1][0].real) / smoothing.sum() if filters[1][0] else 1.0
        return learning, smoothing


def frequency_rule(
    nominal: LearningPlant,
    plants: Sequence[LearningPlant],
    samples: int,
    *,
    gain: float,
    cutoff: float | None,
    forgetting_factor: float,
) -> FrequencyRule:
    """Make the update in the frequency domain; `cutoff` None for the highest that converges."""
    dt = nominal.controller.dt
    frequency = np.arange(samples // 2 + 1) / (samples * dt)
    model = nominal.response(frequency)
    excited = np.abs(model) > NOTHING * np.abs(model).max()
    learning = np.where(excited, gain / np.where(excited, model, 1.0), 0.0)
    without = FrequencyRule(
        frequency=frequency,
        learning=learning,
        forgetting_factor=forgetting_factor,
        cutoff=math.inf,
        samples=samples,
        shares=tuple(
            (one.name, np.abs(forgetting_factor - learning * one.response(frequency)))
            for one in plants
        ),
    )

    def made(edge: float) -> FrequencyRule:
        return replace(without, cutoff=edge)

    if cutoff is not None and (wanted := made(cutoff)).convergence.monotone:
        return wanted
    edge = _highest(made, 0.5 * frequency[1], HIGHEST_CHOSEN / dt, 1.01)
    return _converging(made(edge), None if cutoff is None else wanted)


@dataclass(frozen=True, kw_only=True, eq=False)
class LiftedRule:
    r"""Update by regularised least squares, of a whole trial that begins at rest.

    .. math:: u_{j+1} = Q (\varphi u_j + \gamma (G^T G + r)^{-1} G^T e_j)

    The step minimises :math:`|e_j - G \Delta|^2 + r |\Delta|^2`. Q is a smoothing spline: where it
    is far from the ends, the same low-pass as that of `FrequencyRule`.

    Attributes
    ----------
    keeping, learning : ndarray, shape (m, m)
        Matrices on the learnt voltage, and on the error [V/m].
    late : int
        Samples from a voltage to the first reading that shows it.
    cutoff : float
        Frequency at which Q is a half [Hz].
    convergence : Convergence
        On the models.
    """

    keeping: Array
    learning: Array
    late: int
    cutoff: float
    convergence: Convergence

    def after(self, learnt: Array, error: Array) -> Array:
        """Return the next learnt voltage from the last one and its error.

        Parameters
        ----------
        learnt : ndarray, shape (n,)
            Voltage of the last trial above the feedforward [V].
        error : ndarray, shape (n,)
            Desired less measured displacement [m].

        Returns
        -------
        ndarray, shape (n,)
            For the next trial [V], before the limits.

        Raises
        ------
        ShapeError, DataError
            `learnt` or `error` is no trial of this length, or not finite.
        """
        count = self.keeping.shape[0]
        learnt, error = _trial(learnt, error, count + self.late)
        following = self.keeping @ learnt[:count] + self.learning @ error[self.late :]
        # The last voltages show in no reading.
        return np.concatenate([following, np.full(self.late, following[-1])])


def lifted_rule(
    nominal: LearningPlant,
    plants: Sequence[LearningPlant],
    samples: int,
    *,
    gain: float,
    cutoff: float | None,
    change_weight: float,
    forgetting_factor: float,
) -> LiftedRule:
    """Make the lifted update; `cutoff` None for the highest that converges."""
    from scipy.linalg import toeplitz

    if samples > LONGEST_LIFTED:
        raise ParameterError(
            "reference",
            f"{samples} samples",
            f"{LONGEST_LIFTED} at most with method='lifted'; take a longer dt, or "
            "method='frequency' for one that repeats",
            verb="has",
        )
    dt, pulse = nominal.controller.dt, nominal.impulse(samples)
    late = int(np.argmax(np.abs(pulse) > NOTHING * np.abs(pulse).max()))
    count = samples - late
    if count < 8:
        raise ParameterError(
            "reference", f"{samples} samples", f"8 more than the {late} of the delay", verb="has"
        )

    def lifted(response: Array) -> Array:
        whole: Array = toeplitz(response, np.zeros(samples))
        return whole[late:, :count]

    model = lifted(pulse)
    # An integrator in the feedback leaves no static gain.
    unit = max(float(np.abs(nominal.response(np.zeros(1))[0])) ** 2, float(pulse @ pulse))
    squared = model.T @ model + change_weight * unit * np.eye(count)
    step = np.asarray(gain * np.linalg.solve(squared, model.T), dtype=np.float64)
    still = forgetting_factor * np.eye(count)
    left = [still - step @ lifted(one.impulse(samples)) for one in plants]

    def made(edge: float) -> LiftedRule:
        cases = [
            (plant.name, *_largest(_smoothed(rest, edge * dt), dt))
            for plant, rest in zip(plants, left, strict=True)
        ]
        return LiftedRule(
            keeping=_smoothed(still, edge * dt),
            learning=_smoothed(step, edge * dt),
            late=late,
            cutoff=edge,
            convergence=Convergence._worst(cases),
        )

    if cutoff is not None and (wanted := made(cutoff)).convergence.monotone:
        return wanted
    edge = _highest(made, LOWEST_EDGE / dt, HIGHEST_CHOSEN / dt, 1.1)
    return _converging(made(edge), None if cutoff is None else wanted)


def _smoothed(columns: NDArray[np.floating[Any]], edge: float) -> Array:
    """Smooth columns: Q is a half at `edge`, in parts of the sampling rate.

    Whittaker 1922: the least squares of the columns and of their third differences.
    """
    from scipy.linalg import solveh_banded

    count = columns.shape[0]
    rows = np.zeros((ORDER + 1, count))
    rows[ORDER] = 1.0
    weight = (2.0 * np.sin(np.pi * min(edge, HIGHEST_EDGE))) ** (-2 * ORDER)
    taps = np.array([-1.0, 3.0, -3.0, 1.0])
    for i, tap in enumerate(taps):
        for j in range(i, taps.size):
            # Upper diagonals as solveh_banded keeps them, by the column.
            rows[ORDER - (j - i), j : count - ORDER + j] += weight * tap * taps[j]
    smooth: Array = solveh_banded(rows, columns)
    return smooth


def _largest(matrix: Array, dt: float) -> tuple[float, float]:
    """Return the largest singular value, and the frequency of its input [Hz].

    Lanczos 1950, with all vectors kept orthogonal. Of matrices that are nearly Toeplitz the largest
    singular values crowd together: the vector of one of them is never found, its size soon is.
    """
    vectors = np.empty((min(MOST_STEPS, matrix.shape[1]), matrix.shape[1]))
    following = np.random.default_rng(0).standard_normal(matrix.shape[1])
    diagonal, beside, sizes = [], [], [0.0]
    for k in range(len(vectors)):
        length = float(np.linalg.norm(following))
        if k and length <= 1e-12 * sizes[-1]:
            break
        beside += [length] if k else []
        vectors[k] = following / length
        following = (matrix @ vectors[k]) @ matrix
        diagonal.append(float(vectors[k] @ following))
        for _ in range(2):
            following -= (vectors[: k + 1] @ following) @ vectors[: k + 1]
        values, ritz = np.linalg.eigh(np.diag(diagonal) + np.diag(beside, -1), UPLO="L")
        sizes.append(float(values[-1]))
        if k >= FEW_STEPS and sizes[-1] - sizes[-FEW_STEPS] <= GROWTH * sizes[-1]:
            break
    spectrum = np.abs(np.fft.rfft(ritz[:, -1] @ vectors[: len(diagonal)]))
    frequency = float(np.argmax(spectrum) / (matrix.shape[1] * dt))
    return float(np.sqrt(max(sizes[-1], 0.0))), frequency


def _highest(made: Callable[[float], Rule], low: float, high: float, closely: float) -> float:
    """Find the highest cutoff with which little remains: what remains rises with the cutoff."""
    least = made(low).convergence.factor
    # A stage of small gain learns slowly at any cutoff: a tenth more is what the cutoff may cost.
    most = max(TARGET, least + (1.0 - TARGET) * (1.0 - least))
    if least >= 1.0:
        return low
    if made(high).convergence.factor <= most:
        return high
    while high > closely * low:
        middle = float(np.sqrt(low * high))
        if made(middle).convergence.factor <= most:
            low = middle
        else:
            high = middle
    return low


def _converging(best: R, wanted: R | None) -> R:
    """Return the best update, or refuse that which was asked for, or both.

    Parameters
    ----------
    best : FrequencyRule or LiftedRule
        That of the highest cutoff that converges, if any does.
    wanted : FrequencyRule or LiftedRule or None
        That of a cutoff that was given, which does not.
    """
    if wanted is None and best.convergence.monotone:
        return best
    rule = best if wanted is None else wanted
    remedy = "a smaller learning gain, or models less far apart"
    if best.convergence.monotone:
        remedy = f"a cutoff of {best.cutoff:.3g} Hz in place of {rule.cutoff:.3g}, or {remedy}"
    convergence = rule.convergence
    raise ParameterError(
        f"learning does not converge on {convergence.model}: at {convergence.frequency:.4g} Hz "
        f"a trial leaves {convergence.factor:.4g} times the distance to the final table: "
        "expected below 1, with "
        f"{remedy}",
        argument="cutoff",
    )
