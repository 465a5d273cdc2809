"""Intervals of confidence of what was fitted: from profiles of the cost, or from refits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from .... import _core
from ...._support.display.result import Result
from ...._support.messages import quoted
from ....errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from .covariance import Interval

    Array = NDArray[np.float64]

__all__ = ["Confidence", "LowerMinimum", "ParameterInterval"]

Shape = Literal["bounded", "open below", "open above", "flat", "several minima"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ParameterInterval:
    """Interval of a parameter, and what it follows from.

    Attributes
    ----------
    value : float
        At the least cost, SI.
    unit, symbol : str
        As of `Estimate`.
    interval : Interval
        Its ends, SI; infinite where the cost stays below the threshold up to the bound.
    bounds : (float, float) or None
        Of the search or of the weights, SI; None where the parameter is tied to others.
    on_bound : bool
        Whether the value lies on a bound: the interval is then one-sided.
    shape : {"bounded", "open below", "open above", "flat", "several minima"} or None
        Shape of the profile within the bounds; None of refits.
    factor : float
        Variance over that for an independent residual of the same size, by which the threshold of
        the profile is higher.
    values : ndarray, shape (k,)
        Values of the profile, ascending, or of the refits, SI.
    rises : ndarray, shape (k,)
        Rise of the cost at the values of the profile, over the threshold; empty of refits.
    """

    value: float
    unit: str
    symbol: str
    interval: Interval
    bounds: tuple[float, float] | None
    on_bound: bool
    shape: Shape | None
    factor: float
    values: Array
    rises: Array

    @property
    def determined(self) -> bool:
        """Whether the interval has two ends."""
        return math.isfinite(self.interval.lower) and math.isfinite(self.interval.upper)


@dataclass(frozen=True, kw_only=True)
class LowerMinimum:
    """A minimum below that of a fit, which its profiles met.

    Attributes
    ----------
    cost : float
        Its cost [m], with the priors where there are any.
    fitted_cost : float
        The same of the fit.
    values : dict of str to float
        The parameters there, SI.
    """

    cost: float
    fitted_cost: float
    values: Mapping[str, float]


@dataclass(frozen=True, kw_only=True, eq=False)
class Confidence(Result):
    r"""Intervals of confidence of what was fitted.

    From profiles: with a parameter held, all others and the offset, drift and history of each
    record are fitted again. The interval has the values at which the cost f is not above

    .. math:: (n - p) (f^2 / f_{min}^2 - 1) = \varphi_i \chi^2_1

    (Venzon and Moolgavkar 1988, doi 10.2307/2347496), with the quantile of the chi-squared
    distribution and :math:`\varphi_i = (B M B)_{ii} / (s^2 B_{ii})`, B the inverse of J'J, which
    for a quadratic cost makes it the interval of `Covariance` without its widening. From refits:
    percentiles of the values that are fitted to the model with resampled noise (sieve bootstrap:
    Buehlmann 1997, doi 10.2307/3318584), and with priors that are drawn anew.

    Attributes
    ----------
    method : {"profile", "bootstrap"}
        What the intervals follow from.
    level : float
        Their level.
    parameters : dict of str to ParameterInterval
        The parameters of the model that were fitted, entries of lists as ``"weights[2]"``, and
        the delay of one record.
    cost : float
        Least cost [m], with the priors where there are any.
    lower : LowerMinimum or None
        A minimum below that of the fit, where one was met: the intervals are about it.
    samples : int
        Samples of the records.
    draws : int
        Refits; 0 of profiles.
    notes : tuple of str
        Remarks on single intervals, one sentence each.

    Examples
    --------
    >>> import piezotrack as pt
    >>> log = pt.datasets.dbo_training()[3.0:8.0]
    >>> fit = pt.identify(log, "first-order-dahl", method=pt.Descents(seed=1))
    >>> sure = fit.confidence(0.95, method="profile")
    >>> low, high = sure.interval("piezo_coefficient")
    >>> low <= fit.model.piezo_coefficient <= high
    True
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "identification.views.confidence.confidence_report:confidence_text",
        "plot": "identification.views.confidence.confidence_plot:plot_confidence",
    }

    method: Literal["profile", "bootstrap"]
    level: float
    parameters: Mapping[str, ParameterInterval]
    cost: float
    lower: LowerMinimum | None
    samples: int
    draws: int
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        determined = sum(one.determined for one in self.parameters.values())
        return (
            f"<Confidence, {self.method}, {100.0 * self.level:g} %: "
            f"{determined} of {len(self.parameters)} intervals have two ends>"
        )

    def interval(self, name: str) -> Interval:
        """Return the interval of a parameter.

        Parameters
        ----------
        name : str
            One of `parameters`.

        Returns
        -------
        Interval
            SI.

        Raises
        ------
        ParameterError
            There is no such parameter.
        """
        if name not in self.parameters:
            raise ParameterError("name", quoted(name), f"one of {', '.join(self.parameters)}")
        return self.parameters[name].interval

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only; None for an end or a bound that is open.
        """

        def end(value: float) -> float | None:
            return value if math.isfinite(value) else None

        entries = {
            name: {
                "value": one.value,
                "unit": one.unit,
                "interval": [end(one.interval.lower), end(one.interval.upper)],
                "bounds": None if one.bounds is None else [end(bound) for bound in one.bounds],
                "on_bound": one.on_bound,
                "shape": one.shape,
                "variance_factor": one.factor,
                "values": one.values.tolist(),
                "rises": one.rises.tolist(),
            }
            for name, one in self.parameters.items()
        }
        lower = None
        if self.lower is not None:
            lower = {
                "cost": {"value": self.lower.cost, "unit": "m"},
                "fitted_cost": {"value": self.lower.fitted_cost, "unit": "m"},
                "values": dict(self.lower.values),
            }
        return {
            "format": "piezotrack-confidence",
            "schema_version": 1,
            "method": self.method,
            "level": self.level,
            "cost": {"value": self.cost, "unit": "m"},
            "samples": self.samples,
            "draws": self.draws,
            "parameters": entries,
            "lower_minimum": lower,
            "notes": list(self.notes),
            "provenance": {"package": "piezotrack", "version": _core.__version__},
        }
