"""Fits to whole records, of which the first parts do not show all."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

from ....errors import DataError, NumericalError
from ..judging import period_of, repeated
from ..jump import rest_of
from ..weights import Structure
from .trials import AS_WELL, MANY_WEIGHTS, MORE_THAN_NOISE, NEAR_NOISE, NOTHING_BUT_NOISE

if TYPE_CHECKING:
    from ...fitted.identification import Identification
    from ...fitted.start import Rest
    from ...problem.problem import Problem
    from .trials import Trials, Tried

__all__ = ["OnWholes"]

# What a fit of few values leaves, in multiples of the noise, where no other one is looked for.
ONLY_NOISE = 1.1
# A fit that leaves more than noise gives way to another one that leaves less beside the noise by
# this share; one of many weights has to leave less than others by it, noise included where a drive
# that repeats does not determine them.
BETTER_ON_WHOLE = 0.25


class _Whole(NamedTuple):
    """A model, and its fit to whole records."""

    best: Tried
    fit: Identification


@dataclass(frozen=True)
class OnWholes:
    """Fits to whole records, of which the first parts do not show all."""

    problem: Problem
    trials: Trials

    def fit(self, best: Tried) -> Identification:
        """Fit the best model, or another one that leaves far less on the whole records."""
        found = whole = _Whole(best, self.fitted(best, best.start, best.rest))
        noises, left, few = max(whole.fit.noises), whole.fit.cost, None
        if left < NEAR_NOISE * noises:
            few = self.of_few_values(whole)
            if few is not None and few.cost <= min(ONLY_NOISE * noises, AS_WELL * left):
                return few
        noise = self.unexplained(found.fit)
        if best.info.name == MANY_WEIGHTS or found.fit.cost > NOTHING_BUT_NOISE * noise:
            found = self.least(found)
        # The structure of the first part is that of the whole where nothing but noise is left.
        if found.fit.cost >= NOTHING_BUT_NOISE * min(found.fit.noises):
            found = self.anew(found)
        if few is None or _begun(found.fit) != _begun(whole.fit):
            few = self.of_few_values(found)
        explains = few is not None and few.cost < AS_WELL * found.fit.cost
        return few if few is not None and explains else found.fit

    def fitted(
        self, one: Tried, start: Structure | None = None, rest: Rest | None = None
    ) -> Identification:
        """Fit a model, from a structure or anew."""
        kept = None if start is None else replace(start, kept=True)
        return self.trials.identified(self.problem, one.info, self.trials.how, kept, rest)

    def unexplained(self, fit: Identification) -> float:
        """Return what no model explains [m], less than a fit leaves: noise, or no repetition."""
        floors = [*fit.noises, *(repeated(record.data) for record in self.problem.records)]
        return max((one for one in floors if one < fit.cost), default=fit.cost)

    def above_noise(self, fit: Identification, times: float) -> float:
        """Return the residual whose part that is not noise is so many times that of a fit [m]."""
        noise = self.unexplained(fit)
        return math.hypot(noise, times * math.sqrt((fit.cost - noise) * (fit.cost + noise)))

    def least(self, found: _Whole, shown: Structure | None = None) -> _Whole:
        """Return what was found, or another model that leaves far less.

        Others begin with the structures of their first parts, or with what the whole has shown.
        """
        (best, fit), share = found, 1.0 - BETTER_ON_WHOLE
        many = best.info.name == MANY_WEIGHTS
        repeats = any(period_of(record.data) for record in self.problem.records)
        if many and repeats:
            enough = fit.cost / share
        else:
            enough = self.above_noise(fit, 1.0 / share if many else share)
        for one in self.trials.others(best):
            with suppress(DataError, NumericalError):
                start, rest = (shown, rest_of(fit)) if shown else (one.start, one.rest)
                if (other := self.fitted(one, start, rest)).cost < enough:
                    found, enough = _Whole(one, other), other.cost
        return found

    def anew(self, found: _Whole) -> _Whole:
        """Fit the best model of many weights anew, and others where it shows further dynamics."""
        best, fit = found
        one = next((one for one in [best, *self.trials.others(best)] if one.start), None)
        if one is None or one.start is None or not self.trials.methods.weights._resumes:
            return found
        with suppress(DataError, NumericalError):
            anew = self.fitted(one)
            enough = fit.cost if one is best else self.above_noise(fit, 1.0 - BETTER_ON_WHOLE)
            if anew.cost < enough:
                found, shown = _Whole(one, anew), Structure.of(anew)
                if len(shown.dynamics) > len(one.start.dynamics):
                    return self.least(found, shown)
        return found

    def of_few_values(self, found: _Whole) -> Identification | None:
        """Fit the model of few values, where it may explain as much: it predicts more."""
        best, fit = found
        few = self.trials.of_few_values(best, fit)
        if few is not None and fit.cost > MORE_THAN_NOISE * min(fit.noises):
            with suppress(DataError, NumericalError):
                shown, rest = Structure.of(fit), rest_of(fit)
                return self.trials.searched(self.problem, few.info, self.trials.how, shown, rest)
        return None


def _begun(fit: Identification) -> tuple[list[bool], Rest | None]:
    """Return which records are read late, and the rest before a jump."""
    return [one.delay != 0.0 for one in fit.records], rest_of(fit)
