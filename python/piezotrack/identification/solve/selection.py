"""`model="auto"`: the kind that is best on a part of the record that was not fitted."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import _core
from ..._support.messages import quoted
from ..._support.statistics import sample_noise
from ...errors import DataError, NumericalError, ParameterError
from ...stages.registry import model_named
from ..fitted.trial import Trial
from ..methods.particle_swarm import ParticleSwarm
from ..problem.parameters import ON_PARAMETERS
from .one_model import check_counts, identify_kind

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ...stages.model_info import ModelInfo
    from ..fitted.identification import Identification
    from ..problem.records import Asked

    Array = NDArray[np.float64]

__all__ = [
    "AUTO",
    "identify_best",
    "is_white",
    "kinds_tried",
    "refuse_of_one_model",
    "short_trials",
    "two_parts",
]

AUTO = "auto"
# Kinds that are tried for a drive in volts, and for a force.
OF_VOLTS = ("prandtl-ishlinskii", "first-order-dahl", "parallel-dahl", "bouc-wen")
OF_FORCE = ("bouc-wen-oscillator", "prandtl-ishlinskii")
# Arguments that name parameters of one model.
OF_ONE_MODEL = ("free", "fixed", "initial", "bounds", *ON_PARAMETERS)
# Arguments that least squares cannot follow.
OF_SWARM_ONLY = ("stiffness",)
# Share of the window that is fitted, and turns of the drive that each part needs.
FITTED, TURNS = 0.6, 2
# A residual of so many times the noise, on what was not fitted, is good enough to try no more.
AS_NOISE = 1.5
# Correlation of residuals up to so many samples apart that is that of noise; and what chance makes
# of it, in standard deviations.
APART, CORRELATED, CHANCE = 10, 0.1, 4.0
# Another kind has to be better by this share than one before it in the list.
BETTER = 0.03
# The descent finds the bottom: swarms that only have to find the basin can be short, and those
# that only have to tell the kinds apart few.
ITERATIONS, RUNS = 40, 2


def identify_best(
    one: Asked, *, of_swarm: Mapping[str, Any], least_squares: object
) -> Identification:
    """Identify the kind of stage that describes a record best.

    Parameters
    ----------
    one : Asked
        The record, and what is asked of it.
    of_swarm, least_squares : mapping, object
        As for `identify`, not yet checked.

    Returns
    -------
    Identification
        The best kind, fitted to the whole window.

    Raises
    ------
    ParameterError, DataError, NumericalError, Interrupted
        As for `identify`.
    """
    refuse_of_one_model(of_swarm)
    several, swarm = short_trials(of_swarm)
    infos = kinds_tried(one.data, of_swarm)
    part, rest = two_parts(one.data)
    noise = sample_noise(rest.y)
    trial = several if rest is not part else swarm
    found: list[tuple[Trial, ModelInfo]] = []
    refused: Exception | None = None
    for info in infos:
        try:
            asked = replace(one, data=part)
            fit = identify_kind(asked, info, of_swarm=trial, least_squares=least_squares)
            score = fit.score(rest, offset=fit.offset) if rest is not part else fit.fitted
        except (DataError, NumericalError) as error:
            refused = refused or error
            continue
        found.append((Trial(info.name, info.title, score.rms), info))
        # Of a quick motion, differences from sample to sample are not the noise's alone.
        if score.rms < AS_NOISE * noise and is_white(
            rest.y - fit.simulate(rest, offset=fit.offset).x
        ):
            break
    if not found:
        raise refused or DataError("no kind of stage could be fitted")
    best, info = best_of(found)
    whole = fit if rest is part and best is found[-1][0] else None
    if whole is None:
        whole = identify_kind(one, info, of_swarm=swarm, least_squares=least_squares)
    return with_trials(whole, found, None if rest is part else float(part.t[-1]))


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
        The best kind.
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


def refuse_of_one_model(of_swarm: Mapping[str, Any]) -> None:
    """Refuse arguments that name parameters of one model, and counts that are none.

    Parameters
    ----------
    of_swarm : mapping
        As for `identify_best`.

    Raises
    ------
    ParameterError
        One is given.
    """
    for name in OF_ONE_MODEL:
        if of_swarm[name] is not None:
            raise ParameterError(
                f"{name} is {quoted(of_swarm[name])}: expected none with model='auto'; name the "
                "model whose parameters these are, as model='dahl'"
            )
    check_counts(of_swarm)


def short_trials(of_swarm: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the arguments of the trials on a part, and those of the fit of the best kind.

    Parameters
    ----------
    of_swarm : mapping
        As for `identify_best`.

    Returns
    -------
    trial, full : dict
        The same, but for the size of swarms.
    """
    full = dict(of_swarm)
    if full["method"] == "swarm" and full["swarm"] is None:
        full["swarm"] = ParticleSwarm(iterations=ITERATIONS)
    trial = dict(full)
    if trial["runs"] is None and trial["swarm"] is not None:
        trial["runs"] = RUNS
    return trial, full


def kinds_tried(data: Dataset, of_swarm: Mapping[str, Any]) -> list[ModelInfo]:
    """Return the kinds that can be fitted with what the caller gives.

    Parameters
    ----------
    data : Dataset
        The record.
    of_swarm : mapping
        As for `identify_best`.

    Returns
    -------
    list of ModelInfo
        In the order in which they are tried.
    """
    names = OF_FORCE if data.drive_unit == "N" else OF_VOLTS
    infos = [model_named(name) for name in names]
    needs_swarm = any(of_swarm.get(name) is not None for name in OF_SWARM_ONLY)
    return [info for info in infos if info.searched or not needs_swarm]


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
