"""`model="auto"`: the model that is best on a part of the record that was not fitted."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ...._support.display.progress_parts import Parts
from ....errors import DataError
from ....stages.registry import model_named
from ...fitted.selection import Selection
from ..judging import two_parts
from .on_wholes import OnWholes
from .trials import FEW_VALUES, Trials, Tried

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ....data.dataset import Dataset
    from ....stages.model_info import ModelInfo
    from ...fitted.identification import Identification
    from ...methods.choice import MethodChoice
    from ...problem.problem import Problem
    from ..run import Run

__all__ = ["identify_best", "models_tried"]

# Models whose weights follow by least squares, the simpler first; and models that are searched.
LEAST_SQUARES = (
    "prandtl-ishlinskii",
    "rate-dependent-prandtl-ishlinskii",
    "polynomial-prandtl-ishlinskii",
    "generalised-prandtl-ishlinskii",
    "asymmetric-prandtl-ishlinskii",
    "preisach",
    "duhem",
)
SEARCHED = ("first-order-dahl", "parallel-dahl", "bouc-wen")
# Models that contain another one, whose search costs less: tried where it is near the best.
CONTAINED = {"parallel-dahl": "first-order-dahl"}
OF_FORCE = ("bouc-wen-oscillator", "prandtl-ishlinskii")
# Another model has to be better by this share than one before it in the list; where the record
# has one loop, on which all are judged that were fitted to it, by more.
BETTER, BETTER_ON_ONE_LOOP = 0.03, 0.1
# Time that a search takes beside that of least squares, for the progress.
SLOWER = 5.0


def identify_best(problem: Problem, methods: MethodChoice, run: Run) -> Identification:
    """Identify the model that describes records best.

    Models whose weights follow by least squares come first, and all of them, unless one leaves
    nothing but noise; those after the first begin with its history, creep, drift and dynamics.
    Models that are searched are tried where none of these comes near the noise, Bouc-Wen wherever
    they leave more than noise.

    Parameters
    ----------
    problem : Problem
        The records, of any model.
    methods : MethodChoice
        The methods.
    run : Run
        How it is run.

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
    parts = [two_parts(record.data) for record in problem.records]
    one_loop = any(few for _, _, few in parts)
    halves = zip(problem.records, parts, strict=True)
    first = replace(
        problem, records=tuple(replace(record, data=part) for record, (part, _, _) in halves)
    )
    trials = Trials(first, methods.of_trials(), run, [rest for _, rest, _ in parts])
    infos = models_tried(problem.records[0].data, problem.parameters)
    # About how long each takes; the best is fitted once more at the end.
    shares = Parts([*(SLOWER if info.searched else 1.0 for info in infos), 1.0])
    enough = False
    with trials.side_by_side([info for info in infos if not info.searched]):
        for i, info in enumerate(infos):
            if enough and info.name != FEW_VALUES:
                continue
            if info.searched and not trials.worth_searching(info.name):
                continue
            if not trials.near_best(CONTAINED.get(info.name)):
                continue
            with shares.begin(i):
                enough = trials.run(info) or enough
    if not trials.found:
        raise trials.refused or DataError("no model could be fitted")
    best = best_of(trials.found, BETTER_ON_ONE_LOOP if one_loop else BETTER)

    with shares.begin(len(infos)):
        fit = OnWholes(problem, trials).fit(best)
    return with_trials(fit, trials.found, float(first.records[0].data.t[-1]))


def best_of(tried: Sequence[Tried], better: float = BETTER) -> Tried:
    """Return the best trial, or one before it in the list that is hardly worse.

    Parameters
    ----------
    tried : sequence of Tried
        At least one, in the order in which they were tried. One whose inverse is ill-conditioned
        is taken only where those of all are.
    better : float, optional
        Share by which another has to be better than one before it.

    Returns
    -------
    Tried
        The one to take.
    """
    well = [one for one in tried if not one.ill] or list(tried)
    best = well[0]
    for other in well[1:]:
        if other.trial.rms < (1.0 - better) * best.trial.rms:
            best = other
    return best


def with_trials(fit: Identification, tried: Sequence[Tried], until: float) -> Identification:
    """Put into a result what was tried before it.

    Parameters
    ----------
    fit : Identification
        The best model.
    tried : sequence of Tried
        What was tried.
    until : float
        End of the part that the trials were fitted to [s].

    Returns
    -------
    Identification
        The same with its trials, in its file too.
    """
    trials = tuple(sorted((one.trial for one in tried), key=lambda trial: trial.rms))
    models = {trial.model: {"rms": trial.rms, "unit": "m"} for trial in trials}
    details = {"selection": {"fitted_until_s": until, "models": models}}
    selection = Selection(trials=trials, fitted_until=until)
    return replace(fit, selection=selection, details={**fit.details, **details})


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
    names = OF_FORCE if data.drive_unit == "N" else (*LEAST_SQUARES, *SEARCHED)
    infos = [model_named(name) for name in names]
    return [info for info in infos if info.searched or not parameters]
