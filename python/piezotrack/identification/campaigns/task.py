"""A task of a campaign: one model, one record, one seed, as plain data and a plain function.

The name of a task is the hash of all that its result depends on. How many threads compute it, and
where, is not part of that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.messages import listed, quoted
from ...errors import ExecutorError, ParameterError, PiezotrackError
from ...stages.registry import model_named
from ..fit import identify
from ..fitted.drift import drift_of_asked
from ..methods.descents import Descents
from ..methods.least_squares import LeastSquares
from ..methods.particle_swarm import ParticleSwarm
from ..problem.fingerprint import exact, key_of, plain, record_key
from ..problem.problem import delay_bounds
from ..solve.one_model import refuse_given
from ..solve.selection import AUTO

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...data.dataset import Dataset

__all__ = ["FAILURE", "SCHEMA_VERSION", "Task", "is_searched", "run_task", "settings"]

# Format of the file of a task that found no model.
FAILURE = "piezotrack-campaign-failure"
SCHEMA_VERSION = 1
# Arguments of `identify` that a model of a campaign may have.
OF_PARAMETERS = ("free", "fixed", "bounds", "scales", "ties", "constraints", "priors")
OF_SEARCH = ("stiffness", "creep", "method", "swarm", "descents", "runs")
OF_SWARM = (*OF_PARAMETERS, *OF_SEARCH)
OF_RECORDS = ("offset", "history", "delay", "drift")
GIVEN = ("model", *OF_RECORDS, "least_squares", *OF_SWARM)
# And those that it has in another way.
ELSEWHERE = {
    "seed": "expected it in seeds=",
    "threads": "expected none, as the executor says how many tasks run at a time",
    "progress": "expected progress= of the campaign",
    "callback": "expected none, as a task may run on another machine",
    "checkpoint": "expected none, as the folder of the campaign keeps each result",
    "initial": "expected its values in fixed=, as fixed=dict(step.hysteresis)",
    "data": "expected the record in records=",
}
SETTINGS = {"swarm": ParticleSwarm, "descents": Descents, "least_squares": LeastSquares}


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """One identification of a campaign.

    Attributes
    ----------
    record : Dataset
        The record.
    settings : dict
        Arguments of `identify` in numbers, texts, lists and dicts.
    seed : int or None
        Seed of the random numbers; None for a model that least squares find.
    version : str
        Version of piezotrack that is to compute it.
    threads : int
        Threads of one task, on which its result does not depend.
    name : str
        Hash of all of these but the threads.
    """

    record: Dataset
    settings: dict[str, Any]
    seed: int | None
    version: str = _core.__version__
    threads: int = 1

    @property
    def name(self) -> str:
        """Hash of record, settings, seed and version: 32 hexadecimal digits."""
        seed = None if self.seed is None else str(self.seed)
        return key_of([record_key(self.record), exact(self.settings), seed, self.version])


def run_task(task: Task, stopped: Callable[[], bool] | None = None) -> dict[str, Any]:
    """Identify, and return the content of a file.

    Parameters
    ----------
    task : Task
        What is to be identified.
    stopped : callable, optional
        Asked in every iteration of a swarm whether to give up; in threads of the same process only.

    Returns
    -------
    dict
        Of numbers, texts, lists and dicts: the model file with the entry ``"campaign"``, or, where
        no model was found, a document with the reason.

    Raises
    ------
    ExecutorError
        This process has another version of piezotrack than the caller.
    Interrupted
        Ctrl-C or `stopped` ended the search.
    """
    if task.version != _core.__version__:
        raise ExecutorError(
            f"a worker has piezotrack {_core.__version__}: expected {task.version}, as the caller"
        )
    given = {
        name: SETTINGS[name](**value) if name in SETTINGS else value
        for name, value in task.settings.items()
    }
    if stopped is not None and is_searched(task.settings):
        given["callback"] = lambda _: stopped()
    entry = {"task": task.name, "seed": task.seed, "settings": task.settings}
    try:
        fit = identify(task.record, seed=task.seed, threads=task.threads, progress=False, **given)
    except (PiezotrackError, MemoryError) as error:
        return {
            "format": FAILURE,
            "schema_version": SCHEMA_VERSION,
            "error": {"type": type(error).__name__, "message": str(error) or "not enough memory"},
            "version": task.version,
            "campaign": entry,
        }
    return {**fit.document(), "campaign": {**entry, "notes": fit.notes}}


def is_searched(settings: Mapping[str, Any]) -> bool:
    """Whether the result of these settings depends on the seed."""
    return settings["model"] == AUTO or model_named(settings["model"]).searched


def settings(title: str, given: object) -> dict[str, Any]:
    """Check the arguments of `identify` that a model of a campaign has.

    Parameters
    ----------
    title : str
        Title of the model; also its kind, where ``model`` is not among the arguments.
    given : mapping
        The arguments.

    Returns
    -------
    dict
        The same in numbers, texts, lists and dicts.

    Raises
    ------
    ParameterError
        There is no such kind, or an argument is none of `identify`, does not apply to the kind,
        or is given to a campaign in another way.
    """
    if not isinstance(given, Mapping):
        raise ParameterError(
            f"models: '{title}' is {quoted(given)}: expected arguments of identify, as "
            "{'model': 'dahl', 'runs': 2}"
        )
    for name in given:
        if name in ELSEWHERE:
            raise ParameterError(f"models: '{title}' has {name}: {ELSEWHERE[name]}")
        if name not in GIVEN:
            raise ParameterError(f"models: '{title}' has {quoted(name)}: expected {listed(GIVEN)}")
    found = {name: value for name, value in given.items() if value is not None}
    if found.get("offset") is True:
        # As where it is not given.
        del found["offset"]
    try:
        _check(found.setdefault("model", title), found)
        return {name: plain(name, found[name]) for name in GIVEN if name in found}
    except ParameterError as error:
        raise ParameterError(f"models: '{title}': {error}") from None


def _check(kind: object, found: Mapping[str, Any]) -> None:
    """Refuse what `identify` would refuse for every record."""
    for name, expected in SETTINGS.items():
        if name in found and not isinstance(found[name], expected):
            raise ParameterError(f"{name} is {quoted(found[name])}: expected {expected.__name__}")
    delay_bounds(found.get("delay"))
    drift_of_asked(found.get("drift"), offset=found.get("offset", True) is True, searched=False)
    if "runs" in found:
        _core.as_count("runs", found["runs"])
    if kind == AUTO:
        if of_one := [name for name in OF_PARAMETERS if name in found]:
            raise ParameterError(
                f"{of_one[0]} is given with model='auto': expected the kind whose parameters "
                "these are"
            )
        return
    of_swarm = {**dict.fromkeys((*OF_SWARM, "seed", "threads")), **found}
    for name in ("model", *OF_RECORDS, "least_squares"):
        of_swarm.pop(name, None)
    refuse_given(model_named(kind), of_swarm, found.get("least_squares"))
