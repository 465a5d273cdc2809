"""Covariance of the values of a fit, and the intervals that follow from it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .... import _core
from ...._support.messages import quoted
from ....errors import ParameterError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = [
    "Covariance",
    "Interval",
    "NoiseShares",
    "is_hidden",
    "left_open",
    "normal_reach",
]

# Correlation from which on a pair of values is named.
CORRELATED = 0.95
# The exponent of a Bouc-Wen stage, and the values whose unit it decides.
EXPONENT, BY_EXPONENT = "exponent", ("beta", "gamma")
# Share of its parts from which on a change without effect on the records moves a quantity.
UNSEEN = 1e-3


class Interval(NamedTuple):
    """An interval of confidence.

    Attributes
    ----------
    lower, upper : float
        Its ends, SI.
    """

    lower: float
    upper: float


class NoiseShares(NamedTuple):
    """Parts of the residual of a record with three whole periods of the drive or more.

    Attributes
    ----------
    model_error : float
        Rms of what repeats in every period, which no interval covers [m].
    noise : float
        Rms of the rest [m].
    """

    model_error: float
    noise: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Covariance:
    r"""Covariance of the values that were fitted, for residuals that are correlated.

    With the change J of the displacement with each value, and the covariance G of an autoregression
    of the noise,

    .. math:: C = (J^T J)^{-1} J^T G J (J^T J)^{-1}

    (Domowitz and White 1982, doi 10.1016/0304-4076(82)90012-3; Ljung 1999, System Identification,
    section 9.4). The autoregression has the largest restricted likelihood, which counts the noise
    that the values took along (Cheang and Reinsel 2000, doi 10.1080/01621459.2000.10474318). A
    sieve bootstrap (Buehlmann 1997, doi 10.2307/3318584) of the linearised fit gives the factor by
    which an interval is wider than that of normal deviations.

    Attributes
    ----------
    names : tuple of str
        The values: parameters of the model, entries of lists as ``"weights[2]"``, the delay.
    values : ndarray, shape (p,)
        As fitted, SI.
    matrix : ndarray, shape (p, p)
        Covariance, SI; of values that are not determined without the directions that have no
        effect.
    determined : ndarray of bool, shape (p,)
        Whether the records determine each value.
    independent : ndarray, shape (p,)
        Standard deviations for independent noise of the same size, SI.
    factors : ndarray, shape (p,)
        Variance of each value over that for an independent residual of the same size.
    widening : ndarray, shape (p,)
        Factor of the 95 % interval, by the bootstrap, over that of normal deviations.
    shifts : ndarray, shape (p, 2)
        What generalised least squares would change each value by, and the standard deviation of
        that difference where the noise alone makes it (Hausman 1978, doi 10.2307/1913827).
    to_least_cost : ndarray, shape (p,)
        Change of each value to where the cost is least, which an interval includes: not 0 where the
        fit has the shortest lag that fits as well (`Identification.lags`).
    by_held : ndarray, shape (p, 2)
        What a value that was held would change each value by: a mass that the records do not show,
        or a value on its bound. Its value of least cost, of five standard deviations at most, and
        one standard deviation. An interval reaches as far as that of the fit with it, on the side
        to which it moves the value. 0 where none was held; of several the one that leaves the
        others most open.
    samples : int
        Samples of the records.
    orders : tuple of int
        Order of the autoregression of each record.
    hidden : ndarray, shape (m, p)
        Changes of the values without effect on the records, that of one value its own size [SI].
    predicted : float
        Half width in which 95 % of the errors are expected on a cycle like those of the records
        that was not fitted, as `PredictionBand` has it by amplitude and rate [m].
    shares : NoiseShares or None
        Model error and noise of the first record, where its drive repeats three times or more.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.VirtualStage.of(
    ...     pt.stages.PrandtlIshlinskiiStage(linear=1e-6, thresholds=[10.0], weights=[0.3e-6]),
    ...     noise=20e-9,
    ... )
    >>> t = np.arange(0.0, 4.0, 2e-3)
    >>> log = stage.record(30.0 * (1.0 - np.cos(2.0 * np.pi * t)), 2e-3)
    >>> method = pt.LeastSquares(
    ...     thresholds=[10.0], creep=False, dynamics=None, dead_zones=0
    ... )
    >>> fit = pt.identify(log, "prandtl-ishlinskii", method=method)
    >>> low, high = fit.covariance.interval("linear")
    >>> low < 1e-6 < high, high - low < 1e-9
    (True, True)
    """

    names: tuple[str, ...]
    values: Array
    matrix: Array
    determined: NDArray[np.bool_]
    independent: Array
    factors: Array
    widening: Array
    shifts: Array
    to_least_cost: Array
    by_held: Array
    samples: int
    orders: tuple[int, ...]
    hidden: Array
    predicted: float
    shares: NoiseShares | None = None

    @property
    def deviations(self) -> Array:
        """Standard deviations, SI, shape (p,); infinite where a value is not determined.

        With what a value leaves open that was held (`by_held`), which the matrix has not.
        """
        own = np.sqrt(np.diag(self.matrix))
        return np.where(self.determined, np.hypot(own, left_open(self.by_held)), np.inf)

    @property
    def effective_samples(self) -> Array:
        """Number of independent samples that would determine each value as well, shape (p,)."""
        with np.errstate(all="ignore"):
            return np.asarray(self.samples * (self.independent / self.deviations) ** 2)

    @property
    def decided_by_model(self) -> tuple[str, ...]:
        """Values that another weighting of the same residual would move beyond its noise.

        The error of the model, and not the noise, decides them.
        """
        moved, spread = self.shifts.T
        normal = NormalDist().inv_cdf(0.5 + 0.5 * 0.999)
        beyond = np.abs(moved) > normal * self.widening * spread
        return tuple(name for name, is_so in zip(self.names, beyond, strict=True) if is_so)

    @property
    def correlated(self) -> tuple[tuple[str, str, float], ...]:
        """Pairs of values whose correlation is above 0.95 in size, with it."""
        sizes = np.sqrt(np.diag(self.matrix))
        with np.errstate(all="ignore"):
            correlations = self.matrix / np.outer(sizes, sizes)
        above, rows, columns = np.abs(correlations) > CORRELATED, *np.triu_indices(len(sizes), 1)
        pairs = zip(rows, columns, strict=True)
        return tuple(
            (self.names[i], self.names[j], float(correlations[i, j]))
            for i, j in pairs
            if above[i, j]
        )

    def deviation(self, name: str) -> float:
        """Return the standard deviation of a value.

        Parameters
        ----------
        name : str
            Its name, as in `names`.

        Returns
        -------
        float
            SI; infinite where the records do not determine it.

        Raises
        ------
        ParameterError
            There is no such value.
        """
        return float(self.deviations[self._place(name)])

    def interval(self, name: str, level: float = 0.95) -> Interval:
        """Return the interval of confidence of a value.

        Parameters
        ----------
        name : str
            Its name, as in `names`.
        level : float, optional
            Between 0 and 1.

        Returns
        -------
        Interval
            SI; infinite where the records do not determine the value. Of a value whose unit a
            fitted exponent decides, in the logarithm.

        Raises
        ------
        ParameterError
            There is no such value, or `level` is no share.
        """
        place = self._place(name)
        if not self.determined[place]:
            return Interval(-math.inf, math.inf)
        normal = float(self.widening[place] * normal_reach(level))
        own = math.sqrt(self.matrix[place, place])
        further = _further(normal, own, *self.by_held[place])
        ends = float(self.values[place]) + np.array([0.0, self.to_least_cost[place], further])
        reached = Interval(float(ends.min()) - normal * own, float(ends.max()) + normal * own)
        return self._by_factor(place, reached) if self._follows_exponent(place) else reached

    def _follows_exponent(self, place: int) -> bool:
        """Whether a value changes with a fitted exponent, which decides its unit, by factors."""
        if EXPONENT not in self.names or self.names[place] not in BY_EXPONENT:
            return False
        exponent = self.names.index(EXPONENT)
        own, other = self.matrix[place, place], self.matrix[exponent, exponent]
        return bool(self.matrix[place, exponent] ** 2 > CORRELATED**2 * own * other)

    def _by_factor(self, place: int, reached: Interval) -> Interval:
        """Interval of a value by its logarithm."""
        value = float(self.values[place])
        with np.errstate(over="ignore"):
            ends = value * np.exp(np.array(reached) / value - 1.0)
        return Interval(float(ends.min()), float(ends.max()))

    def reach(self, gradient: Array, level: float = 0.95) -> float:
        """Return half of the interval of a quantity that follows from the values.

        Parameters
        ----------
        gradient : ndarray, shape (p,)
            Its change with each value.
        level : float, optional
            Between 0 and 1.

        Returns
        -------
        float
            In the unit of the quantity; infinite where it follows from what is not determined, and
            where its change with a value is beyond all bounds.

        Raises
        ------
        ParameterError
            `level` is no share.
        """
        normal = normal_reach(level)
        with np.errstate(over="ignore", invalid="ignore"):
            variances = (gradient**2) * np.diag(self.matrix)
            if is_hidden(self.hidden, gradient):
                return math.inf
            whole = float(variances.sum())
            widening = float(variances @ self.widening) / whole if whole > 0.0 else 1.0
            deviation = math.sqrt(max(float(gradient @ self.matrix @ gradient), 0.0))
            further = _further(normal * widening, deviation, *(gradient @ self.by_held))
            reach = normal * widening * deviation
            reach += max(abs(float(gradient @ self.to_least_cost)), abs(further))
        return reach if math.isfinite(reach) else math.inf

    def spread(self, gradients: Array) -> Array:
        """Return standard deviations of quantities, as much wider as intervals of the values are.

        Parameters
        ----------
        gradients : ndarray, shape (p, m)
            Change of each quantity with each value.

        Returns
        -------
        ndarray, shape (m,)
            In the units of the quantities, without what the records do not determine.
        """
        wide = self.widening[:, None] * gradients
        return np.asarray(np.sqrt(np.maximum(np.sum(wide * (self.matrix @ wide), axis=0), 0.0)))

    def _place(self, name: str) -> int:
        if name not in self.names:
            raise ParameterError("name", quoted(name), f"one of {', '.join(self.names)}")
        return self.names.index(name)


def _further(normal: float, deviation: float, moved: float, spread: float) -> float:
    """How much further an interval reaches by a value that was held, to the side of its effect."""
    more = moved * math.copysign(1.0, spread) + normal * (math.hypot(deviation, spread) - deviation)
    return math.copysign(max(more, 0.0), spread)


def left_open(by_held: Array) -> Array:
    """Return the root mean square of what a value that was held would move others by.

    Parameters
    ----------
    by_held : ndarray, shape (p, 2)
        As `Covariance.by_held`.

    Returns
    -------
    ndarray, shape (p,)
        Of values on their side of where it was held, within a tenth.
    """
    moved, spread = by_held.T
    return np.asarray(0.5 * (np.hypot(moved, 2.0 * spread) + moved * np.sign(spread)))


def is_hidden(hidden: Array, gradient: Array) -> bool:
    """Whether a quantity changes with what has no effect on the records.

    Parameters
    ----------
    hidden : ndarray, shape (m, p)
        Changes of the values without effect, as `Covariance.hidden`.
    gradient : ndarray, shape (p,)
        Change of the quantity with each value.

    Returns
    -------
    bool
        Whether the records do not determine it.
    """
    moved = np.abs(hidden @ gradient)
    return bool(np.any(moved > UNSEEN * (np.abs(hidden) @ np.abs(gradient))))


def normal_reach(level: float) -> float:
    """Return what the size of a standard normal deviation stays below with a probability.

    Parameters
    ----------
    level : float
        The probability, between 0 and 1.

    Returns
    -------
    float
        1.96 for 95 %.

    Raises
    ------
    ParameterError
        `level` is no such number.
    """
    share = _core.as_number("level", level)
    if not 0.0 < share < 1.0:
        raise ParameterError("level", share, "a number between 0 and 1")
    return NormalDist().inv_cdf(0.5 + 0.5 * share)
