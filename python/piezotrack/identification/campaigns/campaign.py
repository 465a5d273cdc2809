"""`campaign`: many records, models and seeds, by any executor, with a file for each result."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.arguments import has_entries
from ..._support.messages import quoted
from ...data.dataset import Dataset
from ...errors import ParameterError
from ..problem.fingerprint import record_hash
from ..problem.problem import AUTO
from .folder import CampaignFolder
from .result import Campaign, TaskResult
from .run import Planned, compute
from .task import FAILURE, Task, problem_of, settings

if TYPE_CHECKING:
    import os

__all__ = ["campaign"]


def campaign(
    records: Iterable[Dataset] | Mapping[str, Dataset],
    models: Iterable[str] | Mapping[str, Mapping[str, Any]] = (AUTO,),
    seeds: Iterable[int] = (0,),
    executor: Executor | None = None,
    *,
    folder: str | os.PathLike[str] = "campaign",
    progress: bool | None = None,
) -> Campaign:
    """Identify many models, each in a task of its own, and keep each result in a file.

    A task is one model of one record from one seed; models that least squares find have one task
    for all seeds. Its file is named by the hash of the record (samples, window, hold), the
    settings, the seed and the version of piezotrack, and is a model file that `load` reads. What
    is there is not computed again: the same call does what is missing, and more records, models
    and seeds are added to the same folder. A task computes in one thread where several run at a
    time; its result has the same bits in any number of threads, in any process and on any machine.

    Parameters
    ----------
    records : iterable of Dataset, or mapping of str to Dataset
        The records; with their titles, which are otherwise their sources.
    models : iterable of str, or mapping of str to mapping, optional
        Names as for `identify`, ``"auto"`` among them; or the arguments of `identify` by title, as
        ``{"two runs": {"model": "dahl", "method": pt.Descents(runs=2)}}``. A title that is the name
        of a model needs no ``"model"``.
    seeds : iterable of int, optional
        Seeds of the random numbers.
    executor : concurrent.futures.Executor, optional
        Where the tasks run: a pool of threads or processes, or ``Client.get_executor()`` of
        `dask.distributed`; by default as many threads as there are cores. It is not shut down.
        Workers need no access to the folder.
    folder : path-like, optional
        Folder for the results; made where it is missing.
    progress : bool, optional
        Whether progress is shown, as for `identify`.

    Returns
    -------
    Campaign
        The results, as a sequence, table, data frame and picture. A task that found no model is
        among them with the reason, and is tried again by the next call.

    Raises
    ------
    ParameterError
        `records`, `models` or `seeds` are empty, name something twice or cannot be used.
    DataError
        The folder has other files or those of another campaign, or cannot be written to.
    ExecutorError
        The executor did not return some of the tasks, as a pool whose process was killed. All
        others are in the folder.
    Interrupted
        Ctrl-C. What was finished is in the folder.

    Examples
    --------
    >>> import os, tempfile
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> u = 37.5 * (1 - np.cos(np.arange(1000) / 50.0))
    >>> logs = {
    ...     name: pt.Dataset(u=u, y=factor * pt.DahlStage.xu_li_2010().simulate(u, 0.01).x, dt=0.01)
    ...     for name, factor in {"x axis": 1.0, "y axis": 0.9}.items()
    ... }
    >>> folder = os.path.join(tempfile.mkdtemp(), "both axes")
    >>> found = pt.campaign(logs, ["prandtl-ishlinskii"], folder=folder)
    >>> [(one.record, one.rms_percent < 1.0) for one in found]
    [('x axis', True), ('y axis', True)]
    >>> pt.load(found[0].file) == found[0].fit
    True
    """
    named = _records(records)
    wanted = _models(models)
    solved = {
        title: {model: problem_of(model, given, data) for model, given in wanted.items()}
        for title, data in named.items()
    }
    of_models = {
        model: settings(*problem) for model, problem in next(iter(solved.values())).items()
    }
    _refuse_alike(of_models)
    numbers = _seeds(seeds)
    if executor is not None and not isinstance(executor, Executor):
        hint = (
            "client.get_executor()"
            if hasattr(executor, "get_executor")
            else "ProcessPoolExecutor(4)"
        )
        raise ParameterError(
            "executor", quoted(executor), f"a concurrent.futures.Executor, as {hint}"
        )
    place = CampaignFolder(folder)
    place.begin({record_hash(data): (title, data) for title, data in named.items()}, of_models)
    planned = [
        Planned(task, task.name, record, model)
        for record, problems in solved.items()
        for model, (problem, methods) in problems.items()
        for task in (
            Task(problem=problem, methods=methods, seed=seed)
            for seed in (numbers if problem.is_searched else [None])
        )
    ]
    documents = {task.name: place.result(task.name) for task in planned}
    missing = [
        task for task in planned if (documents[task.name] or {}).get("format") in (None, FAILURE)
    ]
    if missing:
        documents |= compute(missing, executor, place, len(planned), progress)
    results = [
        TaskResult(
            record=task.record,
            model=task.model,
            seed=task.task.seed,
            file=place.file(task.name),
            document=document,
        )
        for task in planned
        if (document := documents[task.name]) is not None
    ]
    return Campaign(results=tuple(results), folder=place.path)


# What is asked for.


def _records(records: object) -> dict[str, Dataset]:
    """Check the records, and give each a title."""
    if isinstance(records, Dataset) or not has_entries(records):
        raise ParameterError("records", quoted(records), "Datasets in a list, as [log]")
    if isinstance(records, Mapping):
        pairs = [(str(title), data) for title, data in records.items()]
    else:
        pairs = [("", data) for data in records]
    if not pairs:
        raise ParameterError("records", "empty", "one Dataset or more")
    for title, data in pairs:
        if not isinstance(data, Dataset):
            of = f" under '{title}'" if title else ""
            raise ParameterError(
                "records",
                f"{quoted(data)}{of}",
                "Datasets, as pt.read or pt.Dataset.from_frame make them",
                verb="has",
            )
    named: dict[str, Dataset] = {}
    keys: dict[str, str] = {}
    sources = [data.source for _, data in pairs]
    for given, data in pairs:
        key = record_hash(data)
        title = given or _title(data, key, alone=sources.count(data.source) == 1)
        if key in keys:
            raise ParameterError(
                "records",
                f"the same samples twice, as '{keys[key]}' and '{title}'",
                "them once",
                verb="has",
            )
        # Two records of one name and window, from two folders.
        title = title if title not in named else f"{title} {key[:6]}"
        named[title], keys[key] = data, title
    return named


def _title(data: Dataset, key: str, *, alone: bool) -> str:
    """Title of a record that was given none."""
    if data.source is None:
        return f"record {key[:6]}"
    return data.source if alone else f"{data.source} {data.t[0]:.6g} to {data.t[-1]:.6g} s"


def _models(models: object) -> dict[str, object]:
    """Check the models: arguments of `identify` by title."""
    if not has_entries(models):
        raise ParameterError("models", quoted(models), "several in a list, as ['dahl']")
    if isinstance(models, Mapping):
        named = {str(title): given for title, given in models.items()}
    else:
        named = {}
        for name in models:
            if not isinstance(name, str):
                raise ParameterError(
                    "models",
                    quoted(name),
                    "names of models, or a mapping of titles to arguments of identify",
                    verb="has",
                )
            if name in named:
                raise ParameterError("models", f"'{name}' twice", "it once", verb="has")
            named[name] = {"model": name}
    if not named:
        raise ParameterError("models", "empty", "one or more")
    return named


def _refuse_alike(models: Mapping[str, dict[str, Any]]) -> None:
    """Refuse the same settings under two titles."""
    titles = list(models)
    for i, title in enumerate(titles):
        if alike := [one for one in titles[:i] if models[one] == models[title]]:
            raise ParameterError(
                "models",
                f"the same settings as '{alike[0]}' and as '{title}'",
                "them once",
                verb="has",
            )


def _seeds(seeds: object) -> list[int]:
    """Check the seeds."""
    if not has_entries(seeds):
        raise ParameterError("seeds", quoted(seeds), "several in a list, as [0, 1] or range(10)")
    counts = [_core.as_count("seeds", seed) for seed in seeds]
    if not counts:
        raise ParameterError("seeds", "empty", "one or more")
    if twice := [seed for i, seed in enumerate(counts) if seed in counts[:i]]:
        raise ParameterError("seeds", f"{twice[0]} twice", "it once", verb="has")
    return counts
