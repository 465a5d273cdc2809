"""A task of a campaign: one problem, one seed, as data that another process can compute.

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
from ..confidence.estimate import with_covariance
from ..methods.choice import MethodChoice
from ..problem.fingerprint import as_plain_data, exact_text, hash_of
from ..problem.problem import AUTO, Problem
from ..problem.records import records_of
from ..solve.run import Run
from ..solve.solution import solve

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...data.dataset import Dataset

__all__ = ["FAILURE", "SCHEMA_VERSION", "Task", "problem_of", "run_task", "settings"]

# Format of the file of a task that found no model.
FAILURE = "piezotrack-campaign-failure"
SCHEMA_VERSION = 2
# Arguments of `identify` that a model of a campaign may have, with those of the record.
OF_RECORD = ("offset", "delay", "drift", "history")
OF_PROBLEM = ("model", "parameters", "constraints", "creep")
GIVEN = (*OF_PROBLEM, *OF_RECORD, "method")
# And those that it has in another way.
ELSEWHERE = {
    "threads": "expected none, as the executor says how many tasks run at a time",
    "progress": "expected progress= of the campaign",
    "callback": "expected none, as a task may run on another machine",
    "checkpoint": "expected none, as the folder of the campaign keeps each result",
    "data": "expected the record in records=",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Task:
    """One identification of a campaign.

    Attributes
    ----------
    problem : Problem
        The model and the record.
    methods : MethodChoice
        How it is solved.
    seed : int or None
        Seed of the random numbers; None for a model that least squares find.
    version : str
        Version of piezotrack that is to compute it.
    threads : int
        Threads of one task, on which its result does not depend.
    name : str
        Hash of all of these but the threads.
    """

    problem: Problem
    methods: MethodChoice
    seed: int | None
    version: str = _core.__version__
    threads: int = 1

    @property
    def name(self) -> str:
        """Hash of problem, method, seed and version: 32 hexadecimal digits."""
        content = [*self.problem.content(), self.methods.settings(seed=False)]
        seed = None if self.seed is None else str(self.seed)
        return hash_of([exact_text(as_plain_data("task", content)), seed, self.version])

    @property
    def settings(self) -> dict[str, Any]:
        """Settings of problem and method in numbers, texts, lists and dicts, without defaults."""
        return settings(self.problem, self.methods)


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
    callback = None if stopped is None or task.seed is None else lambda _: stopped()
    run = Run(threads=task.threads, progress=False, callback=callback)
    methods = task.methods if task.seed is None else task.methods.seeded(task.seed)
    entry = {"task": task.name, "seed": task.seed, "settings": task.settings}
    try:
        fit = with_covariance(solve(task.problem, methods, run))
    except (PiezotrackError, MemoryError) as error:
        return {
            "format": FAILURE,
            "schema_version": SCHEMA_VERSION,
            "error": {"type": type(error).__name__, "message": str(error) or "not enough memory"},
            "version": task.version,
            "campaign": entry,
        }
    return {**fit.document(), "campaign": {**entry, "notes": fit.notes}}


def settings(problem: Problem, methods: MethodChoice) -> dict[str, Any]:
    """Return the settings of a problem of one record and its method as plain data.

    Parameters
    ----------
    problem : Problem
        The problem.
    methods : MethodChoice
        The methods, whose seed is that of the task.

    Returns
    -------
    dict
        Of numbers, texts, lists and dicts, without defaults.
    """
    (of_record,) = problem.record_settings()
    method = as_plain_data("method", methods.settings(seed=False))
    return {**problem.settings(), **of_record, **({"method": method} if method else {})}


def problem_of(title: str, given: object, data: Dataset) -> tuple[Problem, MethodChoice]:
    """Check the arguments of `identify` that a model of a campaign has.

    Parameters
    ----------
    title : str
        Title of the model; also its name, where ``model`` is not among the arguments.
    given : mapping
        The arguments.
    data : Dataset
        The record.

    Returns
    -------
    Problem, MethodChoice
        The problem, and how it is solved.

    Raises
    ------
    ParameterError
        There is no such model, or an argument is none of `identify`, does not apply to the model,
        or is given to a campaign in another way.
    """
    if not isinstance(given, Mapping):
        raise ParameterError(
            f"models['{title}']",
            quoted(given),
            "arguments of identify, as {'model': 'dahl', 'history': 'virgin'}",
        )
    for name in given:
        if name in ELSEWHERE:
            raise ParameterError(
                f"models: '{title}' has {name}: {ELSEWHERE[name]}", argument="models"
            )
        if name not in GIVEN:
            raise ParameterError(f"models['{title}']", quoted(name), listed(GIVEN), verb="has")
    model = given.get("model") or title
    of_record = {"offset": True, **dict.fromkeys(OF_RECORD[1:])}
    of_record |= {name: given[name] for name in OF_RECORD if given.get(name) is not None}
    try:
        records = records_of(data, **of_record)
        of_stage = (given.get(name) for name in OF_PROBLEM[1:])
        problem = Problem.checked(model, records, *of_stage)
        methods = MethodChoice.of(given.get("method"), None if model == AUTO else problem.info)
        if methods.search.seed:
            raise ParameterError(
                "method", f"the seed {methods.search.seed}", "it in seeds=", verb="has"
            )
    except ParameterError as error:
        raise error.of(f"models: '{title}'", argument="models") from None
    return problem, methods
