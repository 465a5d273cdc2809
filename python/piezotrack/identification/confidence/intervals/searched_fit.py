"""A fit around its result: the problem that was solved, and its values there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from .... import _core
from ....data.checks.fast_drive import is_fast
from ....errors import DataError, ParameterError, PiezotrackError
from ...fitted.certainty.confidence import LowerMinimum
from ...fitted.estimates import Estimate
from ...fitted.start import start_after, start_at_jump
from ...linearised.values import DELAY, Value, fitted_values, moved
from ...problem.parameter import Parameter
from ...problem.problem import Problem
from ...problem.records import Record
from ..estimate import covariance_of
from .local_weights import LocalWeights

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...fitted.certainty.covariance import Covariance
    from ...fitted.fitted_record import FittedRecord
    from ...fitted.identification import Identification
    from ...fitted.identified_model import IdentifiedModel

    Array = NDArray[np.float64]
    Local = _core.LocalFit | LocalWeights

__all__ = ["OF_SHORTEST_LAG", "SearchedFit"]

# Factor of the least cost that the shortest lag may have.
LAG_ALLOWED = 1.02
OF_SHORTEST_LAG = (
    "the fit has the shortest lag that fits as well: the intervals are about the least cost, and "
    "include the fitted values"
)


@dataclass(frozen=True)
class SearchedFit:
    """A fit around its result.

    Attributes
    ----------
    fit : Identification
        The result.
    core : LocalFit or LocalWeights
        The records and the coordinates of the search, or of least squares.
    values : ndarray, shape (k,)
        The fitted values in the order of the coordinates, SI.
    names : tuple of str
        Names of the coordinates whose intervals are given, by their places: parameters of the
        model, and the delay of one record.
    factors : dict of str to float
        `Covariance.factors` of each: of one without a covariance, as on a bound, the largest.
    """

    fit: Identification
    core: Local
    values: Array
    names: dict[int, str]
    factors: dict[str, float]

    @classmethod
    def of(cls, fit: Identification) -> Self:
        """Set it up from a fit.

        Raises
        ------
        DataError
            The record is too short.
        """
        info, covariance = fit.model.info, fit.covariance
        if covariance is None:
            count = sum(len(one.data) for one in fit.records if one.data is not None)
            raise DataError(
                f"the record has {count} samples for {len(fitted_values(fit))} fitted values: too "
                "short for intervals"
            )
        core: Local = _core.LocalFit(_problem(fit)) if info.searched else LocalWeights(fit)
        several = len(fit.records) > 1
        values, names = [], {}
        for place, (record, name, _, _) in enumerate(core.coordinates):
            value, own = Value.named(name), fit.records[record].parameters
            values.append(own[name].value if name in own else value.of(fit))
            of_model = value.parameter in {one.name for one in info.parameters}
            if of_model or (name == DELAY and not several):
                names[place] = name
        return cls(fit, core, np.array(values), names, _factors(covariance, names))

    def at(self, least: list[float]) -> Self:
        """Return the same with the factors at other values, where there is a covariance there."""
        places = [place for place, name in self.names.items() if name != DELAY]
        values = [Value.named(self.names[place]) for place in places]
        changes = np.array([least[place] - self.values[place] for place in places])
        nearby = moved(self.fit, values, changes)
        records = [(one.data, one.weight) for one in self.fit.records if one.data is not None]
        if nearby is None:
            return self
        begun = tuple(_begun(nearby, one) for one in self.fit.records)
        try:
            nearby = replace(nearby, records=begun, start=begun[0].start)
            covariance = covariance_of(nearby, records)
        except PiezotrackError:
            return self
        return replace(self, factors=_factors(covariance, self.names))

    @property
    def samples(self) -> int:
        """Samples of the records that count."""
        records = [one.data for one in self.fit.records if one.data is not None]
        return sum(int(one.counted(one.y).size) for one in records)

    @property
    def freedom(self) -> int:
        """Samples less what was fitted, with the offset and the drift of each record."""
        own = sum(int(one.offset_fitted) + bool(one.drift) for one in self.fit.records)
        # Least squares have the weights of the creep among their values.
        weights = self.fit.model.creep_weights if self.fit.model.info.searched else ()
        creep = len([one for one in weights if one > 0.0])
        return self.samples - len(self.values) - own - creep

    @property
    def cost(self) -> float:
        """Cost of the fit, with the priors [m]."""
        return self.core.cost(self.values.tolist())

    def estimate(self, name: str) -> Estimate:
        """Return the estimate of a parameter, or of an entry of a list."""
        if name in self.fit.parameters:
            return self.fit.parameters[name]
        value = Value.named(name)
        known = {one.name: (one.unit, one.symbol) for one in self.fit.model.info.parameters}
        unit, symbol = known.get(value.parameter, ("s", "tau"))
        entry = "" if value.entry is None else str(value.entry + 1)
        return Estimate(
            value=value.of(self.fit),
            unit=unit,
            symbol=symbol + entry,
            free=True,
            bounds=None,
            deviation=None,
            at_bound=False,
        )

    def beside(
        self, least: list[float], cost: float, rise: float
    ) -> tuple[bool, LowerMinimum | None]:
        """Say why the least cost is lower than that of the fit.

        Parameters
        ----------
        least : list of float
            Values at the least cost, in the order of the coordinates.
        cost : float
            The least cost [m].
        rise : float
            Relative rise of the squared cost that matters.

        Returns
        -------
        shortest : bool
            Whether the fit has the shortest lag that fits as well.
        lower : LowerMinimum or None
            The minimum, where it is another one.
        """
        fitted = self.cost
        if not (fitted / cost) ** 2 - 1.0 > rise:
            return False, None
        if self.fit.lags is not None and fitted < LAG_ALLOWED * cost:
            return True, None
        values = {name: least[place] for place, name in self.names.items()}
        return False, LowerMinimum(cost=cost, fitted_cost=fitted, values=values)


def _begun(model: IdentifiedModel, record: FittedRecord) -> FittedRecord:
    """Return a record that begins with a state of another stage."""
    start, data, stage = record.start, record.data, model.model
    if start is None or data is None:
        return record
    if start.rest is not None:
        return replace(record, start=start_at_jump(stage, data, start.rest))
    begun = start_after(stage, data, start.history, start.voltage, creeps=False)
    return replace(record, start=begun)


def _factors(covariance: Covariance, names: dict[int, str]) -> dict[str, float]:
    """Return the factor of each; of those without one the largest."""
    known = dict(zip(covariance.names, covariance.factors.tolist(), strict=True))
    return {name: known.get(name, max(known.values())) for name in names.values()}


def _problem(fit: Identification) -> Problem:
    """Return the problem that a fit solved, its bounds written out."""
    parameters = {}
    for one in fit.model.info.parameters:
        estimate = fit.parameters.get(one.name)
        if not one.is_list and estimate is not None:
            parameters[one.name] = _parameter(estimate)
    return Problem(
        model=fit.model.info.name,
        records=tuple(_record(fit, one) for one in fit.records),
        parameters=parameters,
        constraints=tuple(one.text for one in fit.constraints),
        creep=fit.model.creep_times or None,
    )


def _parameter(estimate: Estimate) -> Parameter:
    if estimate.tie is not None:
        return Parameter(tie=estimate.tie, prior=estimate.prior)
    if not estimate.free:
        return Parameter(estimate.value)
    return Parameter(bounds=estimate.bounds, scale=estimate.scale, prior=estimate.prior)


def _record(fit: Identification, own: FittedRecord) -> Record:
    data, history = own.data, own.start.history if own.start else "virgin"
    if data is None:
        raise ParameterError("model", "no record", "what pt.identify returns", verb="has")
    rest = own.start.rest if own.start else None
    if rest is not None:
        before = data._preceded(*rest)
        data, history = before[float(before.t[0]) :], "virgin"
    elif fit.interpolation and data.inserted is None and is_fast(data):
        data = data.interpolate(fit.interpolation)
    delay = own.parameters.get(DELAY)
    drift = own.drift
    return Record(
        data,
        offset=own.offset_fitted,
        delay=delay.bounds if delay is not None and delay.free else own.delay or None,
        drift=None if drift is None else drift.time_fitted or drift.time,
        history=history,
        weight=own.weight,
    )
