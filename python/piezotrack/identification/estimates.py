"""The small parts of a result: where a search stands, what it found of one parameter."""

from __future__ import annotations

from typing import Literal, NamedTuple

__all__ = ["Estimate", "Progress", "Run", "StopReason"]

StopReason = Literal["stalled", "iterations", "interrupted"]


class Progress(NamedTuple):
    """Where a search stands after an iteration.

    Attributes
    ----------
    nit : int
        Iterations done; 0 after the first evaluation.
    iterations : int
        Most iterations.
    nfev : int
        Simulations done.
    cost_um : float
        Best cost so far [um].
    parameters : dict of str to float
        The parameters that gave it, SI.
    delay : float
        The delay that gave it [s].
    """

    nit: int
    iterations: int
    nfev: int
    cost_um: float
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
        Standard deviation that the residuals and the sensitivity of the model imply, for
        independent deviations. Deviations of a model that is not quite right hang together,
        so the true spread is larger.
    at_bound : bool
        Whether the value lies on a bound.
    """

    value: float
    unit: str
    symbol: str
    free: bool
    bounds: tuple[float, float] | None
    deviation: float | None
    at_bound: bool

    @property
    def precise(self) -> bool:
        """Whether the standard deviation is below half of the value, or the value held."""
        if not self.free:
            return True
        return self.deviation is not None and self.deviation < 0.5 * abs(self.value)

    @property
    def identified(self) -> bool:
        """Whether the record fixes the value: to better than a half, and inside its bounds."""
        return self.precise and not self.at_bound


class Run(NamedTuple):
    """One of the swarms of a search.

    Attributes
    ----------
    cost : float
        Its lowest cost [m], polished where asked.
    nit, nfev : int
        Its iterations and simulations.
    stop_reason : {"stalled", "iterations", "interrupted"}
        Why it ended.
    """

    cost: float
    nit: int
    nfev: int
    stop_reason: StopReason
