"""Parts of a result: estimates of parameters, progress and course of a search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Constraint", "Estimate", "LagRange", "Progress", "SearchRun", "StopReason", "SwarmRun"]

# Share of a prior's width from which on a standard deviation is the prior's.
OF_PRIOR = 0.9
StopReason = Literal["agreed", "converged", "stalled", "iterations", "interrupted", "solved"]


class Progress(NamedTuple):
    """Progress of a search after an iteration.

    Attributes
    ----------
    nit : int
        Iterations done; 0 after the first evaluation.
    iterations : int
        Largest number of iterations.
    nfev : int
        Simulations done.
    cost : float
        Best cost so far [m], with the priors where there are any.
    parameters : dict of str to float
        Parameters of the best candidate, SI.
    delay : float
        Delay of the best candidate [s].
    """

    nit: int
    iterations: int
    nfev: int
    cost: float
    parameters: dict[str, float]
    delay: float = 0.0


class Estimate(NamedTuple):
    """One parameter as identified.

    Attributes
    ----------
    value : float
        In `unit`.
    unit : str
        SI; empty where there is none.
    symbol : str
        As in the literature.
    free : bool
        Whether it was searched.
    bounds : (float, float) or None
        Of the search.
    deviation : float or None
        Standard deviation for residuals that are correlated, as of `Covariance`; None of a value
        on a bound, on one side of which there are no others. Infinite where the parameter has no
        effect on the data, such as a mass that a record does not show and that was held for
        that.
    at_bound : bool
        Whether the value lies on a bound, or on a constraint.
    scale : {"linear", "log"} or None
        How the search went through the bounds.
    tie : str or None
        The expression of others from which the value follows.
    prior : (float, float) or None
        Value and standard deviation that were known besides the record, in `unit`.
    """

    value: float
    unit: str
    symbol: str
    free: bool
    bounds: tuple[float, float] | None
    deviation: float | None
    at_bound: bool
    scale: Literal["linear", "log"] | None = None
    tie: str | None = None
    prior: tuple[float, float] | None = None

    @property
    def precise(self) -> bool:
        """Whether the standard deviation is below half of the value, or the value was given."""
        if not self.free and self.deviation is None:
            return True
        return self.deviation is not None and self.deviation < 0.5 * abs(self.value)

    @property
    def identified(self) -> bool:
        """Whether the record determines the value: `precise`, not on a bound, not `from_prior`."""
        return self.precise and not self.at_bound and not self.from_prior

    @property
    def from_prior(self) -> bool:
        """Whether the prior alone determines the value: the record hardly narrows it."""
        return (
            self.prior is not None
            and self.deviation is not None
            and self.deviation > OF_PRIOR * self.prior[1]
        )


class Constraint(NamedTuple):
    """An inequality between two parameters.

    Attributes
    ----------
    text : str
        As it was given.
    lower, upper : str
        Names of the smaller and of the larger parameter.
    active : bool
        Whether it decides the result: the two are equal.
    """

    text: str
    lower: str
    upper: str
    active: bool


class LagRange(NamedTuple):
    """Lags with which a model fits a record as well as with the best one.

    Attributes
    ----------
    least, most : float
        Ends of the range within which the cost is at most a hundredth above its least [s]. Of a
        swarm the model has the least one; of least squares, which are surer of their minimum, the
        least within 0.3 % of the cost.
    from_zero : bool
        Whether the model fits as well without any lag.
    """

    least: float
    most: float
    from_zero: bool


class SwarmRun(NamedTuple):
    """One of the independent restarts of a swarm, or one descent.

    Attributes
    ----------
    cost : float
        Its lowest cost [m], after local refinement where that is asked for, and with the priors
        where there are any.
    nit, nfev : int
        Its iterations and simulations.
    stop_reason : {"agreed", "converged", "stalled", "iterations", "interrupted"}
        Why it ended.
    """

    cost: float
    nit: int
    nfev: int
    stop_reason: StopReason


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchRun:
    """Course of the search that identified a model.

    Attributes
    ----------
    runs : tuple of SwarmRun
        The independent restarts of a swarm, or the descents; `history` and `nit` are those of the
        best one.
    agreeing_runs : int
        Number of runs that ended within 0.1 % of the lowest cost; of descents before the local
        refinement of the best one. Costs below 0.001 % of the stroke count as equal.
    history : ndarray, shape (nit + 1,)
        Best cost after each iteration of the best run [m], with the priors where there are any.
    nit : int
        Iterations of the swarm, or of the descent, that found the best candidate.
    nfail : int
        Simulations that diverged.
    npolish : int
        Simulations of the local refinement after that run, which `history` does not include.
    substeps, order : int
        Steps of the integrator in each sampling interval and their order, fixed for the search.
    scales : dict of str to str
        The scales that were given.
    cost_with_priors : float or None
        What was minimised where there were priors [m]: the cost times the factor of the priors,
        see `identify`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> log = pt.datasets.dbo_training()[3.0:5.0]
    >>> few = pt.ParticleSwarm(iterations=3, runs=2, seed=1)
    >>> search = pt.identify(log, "dahl", method=few, progress=False).search
    >>> search.nit, search.history.shape, len(search.runs)
    (3, (4,), 2)
    """

    runs: tuple[SwarmRun, ...]
    agreeing_runs: int
    history: NDArray[np.float64]
    nit: int
    nfail: int
    npolish: int
    substeps: int
    order: int
    scales: Mapping[str, str]
    cost_with_priors: float | None
