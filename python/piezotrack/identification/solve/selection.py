"""`model="auto"`: the model that is best on a part of the record that was not fitted."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ..._support.statistics import sample_noise
from ...errors import DataError, NumericalError
from ...stages.registry import model_named
from ..fitted.trial import Trial
from .one_model import identify_model

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ...stages.model_info import ModelInfo
    from ..fitted.identification import Identification
    from ..methods.choice import MethodChoice
    from ..problem.problem import Problem
    from .run import Run

    Array = NDArray[np.float64]

__all__ = ["best_of_several", "identify_best", "is_white", "models_tried", "two_parts"]

# Models that are tried for a drive in volts, and for a force.
OF_VOLTS = ("prandtl-ishlinskii", "first-order-dahl", "parallel-dahl", "bouc-wen")
OF_FORCE = ("bouc-wen-oscillator", "prandtl-ishlinskii")
# Share of the window that is fitted, and turns of the drive that each part needs.
FITTED, TURNS = 0.6, 2
# A residual of so many times the noise, on what was not fitted, is good enough to try no more.
AS_NOISE = 1.5
# Correlation of residuals up to so many samples apart that is that of noise; and what chance makes
# of it, in standard deviations.
APART, CORRELATED, CHANCE = 10, 0.1, 4.0
# Another model has to be better by this share than one before it in the list.
BETTER = 0.03


def identify_best(problem: Problem, methods: MethodChoice, run: Run) -> Identification:
    """Identify the model that describes a record best.

    Parameters
    ----------
    problem : Problem
        One record, of any model.
    methods : MethodChoice
        The methods.
    run : Run
        How it is run.

    Returns
    -------
    Identification
        The best model, fitted to the whole window.

    Raises
    ------
    ParameterError, DataError, NumericalError, Interrupted
        As for `identify`.
    """
    (record,) = problem.records
    part, rest = two_parts(record.data)
    noise = sample_noise(rest.y)
    first = replace(problem, records=(replace(record, data=part),))
    of_trials = methods.of_trials() if rest is not part else methods
    found: list[tuple[Trial, ModelInfo]] = []
    refused: Exception | None = None
    for info in models_tried(problem.records[0].data, problem.parameters):
        try:
            fit = identify_model(first.of_model(info), of_trials.method(info), run)
            score = fit.score(rest, offset=fit.offset) if rest is not part else fit.fitted
        except (DataError, NumericalError) as error:
            refused = refused or error
            continue
        found.append((Trial(info.name, info.title, score.rms), info))
        # Of a quick motion, differences from sample to sample are not the noise's alone.
        if score.rms < AS_NOISE * noise and is_white(
            rest.counted(rest.y - fit.simulate(rest, offset=fit.offset).x)
        ):
            break
    if not found:
        raise refused or DataError("no kind of stage could be fitted")
    best, info = best_of(found)
    whole = fit if rest is part and best is found[-1][0] else None
    if whole is None:
        whole = identify_model(problem.of_model(info), methods.method(info), run)
    return with_trials(whole, found, None if rest is part else float(part.t[-1]))


def best_of_several(problem: Problem, methods: MethodChoice, run: Run) -> Identification:
    """Identify the model that describes several records best.

    Parameters
    ----------
    problem : Problem
        The records, of any model.
    methods, run : MethodChoice, Run
        As for `identify_best`.

    Returns
    -------
    Identification
        The best model, fitted to the whole windows. The trials were fitted to the first part of
        each window and judged on the rest of each.

    Raises
    ------
    ParameterError, DataError, NumericalError, Interrupted
        As for `identify`.
    """
    records = problem.records
    pairs = [two_parts(one.data) for one in records]
    apart = all(part is not rest for part, rest in pairs)
    of_trials = methods.of_trials() if apart else methods
    first, rests = problem, [one.data for one in records]
    if apart:
        halves = zip(records, pairs, strict=True)
        first = replace(
            problem, records=tuple(replace(one, data=part) for one, (part, _) in halves)
        )
        rests = [rest for _, rest in pairs]
    counts = np.array([one.weight * len(rest) for one, rest in zip(records, rests, strict=True)])
    found: list[tuple[Trial, ModelInfo]] = []
    refused: Exception | None = None
    fit: Identification | None = None
    for info in models_tried(problem.records[0].data, problem.parameters):
        try:
            fit = identify_model(first.of_model(info), of_trials.method(info), run)
            left = [
                rest.counted(rest.y - fit.simulate(rest, offset=own.offset).x)
                for rest, own in zip(rests, fit.records, strict=True)
            ]
        except (DataError, NumericalError) as error:
            refused = refused or error
            continue
        rms = np.array([math.sqrt(float(np.mean(one**2))) for one in left])
        whole = math.sqrt(float(counts @ rms**2) / float(counts.sum()))
        found.append((Trial(info.name, info.title, whole), info))
        noise = [sample_noise(rest.y) for rest in rests]
        if np.all(rms < AS_NOISE * np.array(noise)) and all(is_white(one) for one in left):
            break
    if not found or fit is None:
        raise refused or DataError("no kind of stage could be fitted")
    best, info = best_of(found)
    if apart or best is not found[-1][0]:
        fit = identify_model(problem.of_model(info), methods.method(info), run)
    return with_trials(fit, found, float(first.records[0].data.t[-1]) if apart else None)


def best_of(found: Sequence[tuple[Trial, ModelInfo]]) -> tuple[Trial, ModelInfo]:
    """Return the best trial, or one before it in the list that is hardly worse.

    Parameters
    ----------
    found : sequence of (Trial, ModelInfo)
        At least one, in the order in which they were tried.

    Returns
    -------
    Trial, ModelInfo
        The one to take.
    """
    best = found[0]
    for other in found[1:]:
        if other[0].rms < (1.0 - BETTER) * best[0].rms:
            best = other
    return best


def with_trials(
    fit: Identification, found: Sequence[tuple[Trial, ModelInfo]], until: float | None
) -> Identification:
    """Put into a result what was tried before it.

    Parameters
    ----------
    fit : Identification
        The best model.
    found : sequence of (Trial, ModelInfo)
        What was tried.
    until : float or None
        End of the part that the trials were fitted to [s]; None where that was the whole.

    Returns
    -------
    Identification
        The same with its trials, in its file too.
    """
    trials = tuple(sorted((one for one, _ in found), key=lambda one: one.rms))
    models = {one.model: {"rms": one.rms, "unit": "m"} for one in trials}
    details = {"selection": {"fitted_until_s": until, "models": models}}
    return replace(fit, trials=trials, fitted_until=until, details={**fit.details, **details})


def models_tried(data: Dataset, parameters: Mapping[str, object]) -> list[ModelInfo]:
    """Return the models that can be fitted with what the caller gives.

    Parameters
    ----------
    data : Dataset
        The record, or the first of several.
    parameters : mapping
        The parameters of which something is said.

    Returns
    -------
    list of ModelInfo
        In the order in which they are tried; where a parameter is given, those that are searched.
    """
    names = OF_FORCE if data.drive_unit == "N" else OF_VOLTS
    infos = [model_named(name) for name in names]
    return [info for info in infos if info.searched or not parameters]


def two_parts(data: Dataset) -> tuple[Dataset, Dataset]:
    """Part a record for trials; the whole twice where the drive turns too seldom.

    Parameters
    ----------
    data : Dataset
        The record.

    Returns
    -------
    part, rest : Dataset
        To fit, and to judge on.
    """
    turns = np.array(_core.turns(data.u, 0.2 * float(np.ptp(data.u))), dtype=np.intp)
    for place in turns[np.argsort(np.abs(turns - FITTED * len(data)))]:
        before, after = int(np.sum(turns < place)), int(np.sum(turns >= place))
        if before >= TURNS and after >= TURNS:
            middle = float(data.t[place])
            return data[data.t[0] : middle], data[middle:]
    return data, data


def is_white(rest: Array) -> bool:
    """Return whether residuals are noise from sample to sample: nothing is left to describe.

    Parameters
    ----------
    rest : ndarray, shape (n,)
        The residuals [m].

    Returns
    -------
    bool
        Whether no correlation is left.
    """
    rest = rest - rest.mean()
    squares = float(rest @ rest)
    if rest.size <= APART or squares == 0.0:
        return True
    most = max(abs(float(rest[:-k] @ rest[k:])) for k in range(1, APART + 1))
    return most < max(CORRELATED, CHANCE / math.sqrt(rest.size)) * squares
