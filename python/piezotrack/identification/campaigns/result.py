"""Results of a campaign: a sequence, as a table, a data frame and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, overload

from ..._support.display.frames import frame_of
from ..._support.display.result import Result
from ..._support.files.writing import replacing
from ...errors import DataError, ParameterError
from ..fitted.model_file import load
from .task import FAILURE

if TYPE_CHECKING:
    import os

    from ..fitted.identified_model import IdentifiedModel

__all__ = ["Campaign", "TaskResult", "check_parquet", "size_of"]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class TaskResult:
    """One model of one record from one seed; see `campaign`.

    Attributes
    ----------
    record, model : str
        Titles of the record and of the model.
    seed : int or None
        Seed of the random numbers; None for a model that least squares find.
    file : pathlib.Path
        The file, which `load` reads where a model was found.
    document : mapping
        Its content.
    """

    record: str
    model: str
    seed: int | None
    file: Path
    document: Mapping[str, Any] = field(repr=False)

    def __repr__(self) -> str:
        seed = "" if self.seed is None else f", seed {self.seed}"
        found = f"{self.rms_percent:.3g} % of stroke" if self.error is None else self.error
        return f"<TaskResult, {self.record}, {self.model}{seed}: {found}>"

    @property
    def task(self) -> str:
        """Hash of record, settings, seed and version: the name of the file."""
        return self.file.stem

    @property
    def error(self) -> str | None:
        """Why no model was found; None where one was."""
        if self.document["format"] != FAILURE:
            return None
        return str(self.document["error"]["message"])

    @cached_property
    def fit(self) -> IdentifiedModel:
        """The model, read from the file.

        Raises
        ------
        DataError
            None was found, or the file has gone.
        """
        if self.error is not None:
            raise DataError(f"no model was found of {self.record}: {self.error}")
        return load(self.file)

    @property
    def kind(self) -> str | None:
        """Name of the model found; None where none was."""
        return self.document.get("model")

    @property
    def rms(self) -> float:
        """Cost of the fit, RMS deviation in the window [m]; NaN where no model was found."""
        return self._number("fit", "cost", "value")

    @property
    def rms_percent(self) -> float:
        """The same in per cent of the stroke."""
        return 100.0 * self.rms / self._number("stroke", "value")

    @property
    def notes(self) -> list[str]:
        """Warnings about the record and the fit, one sentence each."""
        return list(self.document["campaign"].get("notes", []))

    @property
    def row(self) -> dict[str, Any]:
        """The figures by title, with their units, and the parameters that are numbers."""
        values = {
            "record": self.record,
            "model": self.model,
            "kind": self.kind,
            "seed": self.seed,
            "rms_um": 1e6 * self.rms,
            "rms_percent": self.rms_percent,
            "fit_percent": self._number("fit", "fit_percent", "value"),
            "stroke_um": 1e6 * self._number("stroke", "value"),
            "offset_um": 1e6 * self._number("offset", "value"),
            "delay_s": self._number("delay", "value"),
            "drift_um": 1e6 * self._number("drift", "amplitude", "value"),
            "notes": len(self.notes),
            "error": self.error,
            "task": self.task,
        }
        for name, entry in self.document.get("parameters", {}).items():
            if isinstance(entry["value"], (int, float)):
                values["_".join(filter(None, (name, entry["unit"])))] = entry["value"]
        return values

    def _number(self, *path: str) -> float:
        value: Any = self.document
        for name in path:
            value = value.get(name) if isinstance(value, Mapping) else None
        return float("nan") if value is None else float(value)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Campaign(Result, Sequence[TaskResult]):
    """Models of many records; see `campaign`.

    A sequence of `TaskResult`: ``found[0]``, ``len(found)``, ``for one in found``.

    Attributes
    ----------
    results : tuple of TaskResult
        One for each task: record by record, in each model by model, in each seed by seed.
    folder : pathlib.Path
        Where the files are.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "identification.views.campaign_report:campaign_text",
        "plot": "identification.views.campaign_plot:plot_campaign",
        "html": "identification.views.campaign_report:campaign_html",
    }

    results: tuple[TaskResult, ...]
    folder: Path

    @overload
    def __getitem__(self, index: int) -> TaskResult: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[TaskResult, ...]: ...
    def __getitem__(self, index: int | slice) -> TaskResult | tuple[TaskResult, ...]:
        return self.results[index]

    def __len__(self) -> int:
        return len(self.results)

    def __repr__(self) -> str:
        return f"<Campaign, {size_of(self)}; see summary()>"

    @classmethod
    def load(cls, folder: str | os.PathLike[str]) -> Campaign:
        """Read what is in the folder of a campaign, also of one that is under way.

        Parameters
        ----------
        folder : path-like
            The folder.

        Returns
        -------
        Campaign
            All results; of those of one record, model and seed by several versions of piezotrack
            the one written last.

        Raises
        ------
        DataError
            It is not the folder of a campaign.
        """
        from .folder import NAME, CampaignFolder

        place = CampaignFolder(folder)
        if not place.document:
            raise DataError(f"folder {place.path} has no {NAME}: expected that of a campaign")
        latest = {}
        for document in place.results():
            entry = document["campaign"]
            title, model, seed = entry.get("record"), entry.get("model"), entry.get("seed")
            latest[(title, model, seed)] = TaskResult(
                record=str(title),
                model=str(model),
                seed=seed,
                file=place.file(entry["task"]),
                document=document,
            )
        # As they were first given.
        known = place.document["records"].values()
        records = {one.get("title"): i for i, one in enumerate(known) if isinstance(one, dict)}
        models = {title: i for i, title in enumerate(place.document["models"])}
        ordered = sorted(
            latest.values(),
            key=lambda one: (records.get(one.record, 0), models.get(one.model, 0), one.seed or 0),
        )
        return cls(results=tuple(ordered), folder=place.path)

    @property
    def records(self) -> list[str]:
        """Titles of the records."""
        return list(dict.fromkeys(one.record for one in self))

    @property
    def models(self) -> list[str]:
        """Titles of the models."""
        return list(dict.fromkeys(one.model for one in self))

    @property
    def failed(self) -> tuple[TaskResult, ...]:
        """The tasks in which no model was found; the same call tries them again."""
        return tuple(one for one in self if one.error is not None)

    @property
    def best(self) -> dict[tuple[str, str], TaskResult]:
        """Of each record and model the seed with the lowest cost."""
        found = sorted((one for one in self if one.error is None), key=lambda one: -one.rms)
        lowest = {(one.record, one.model): one for one in found}
        return {key: lowest[key] for key in self.groups if key in lowest}

    @property
    def groups(self) -> dict[tuple[str, str], list[TaskResult]]:
        """The seeds of each record and model."""
        groups: dict[tuple[str, str], list[TaskResult]] = {}
        for one in self:
            groups.setdefault((one.record, one.model), []).append(one)
        return groups

    def document(self) -> dict[str, Any]:
        """Return the figures of all tasks, as `to_frame` has them, with the notes in words.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {"results": [{**one.row, "notes": one.notes} for one in self]}

    def to_frame(self) -> Any:
        """Return the figures and the parameters as a data frame of pandas.

        Returns
        -------
        pandas.DataFrame
            One row for each task: titles, kind, seed, costs, offset, number of notes, error, name
            of the task, and the parameters that are numbers, with their units in the titles. A
            parameter that a model does not have is missing.

        Raises
        ------
        ParameterError
            pandas is not installed.
        """
        rows = [one.row for one in self]
        titles = list(dict.fromkeys(title for row in rows for title in row))
        frame = frame_of({title: [row.get(title) for row in rows] for title in titles})
        # Where least squares need no seed a plain column would have 0.0 in place of 0.
        return frame.astype({"seed": "Int64"})

    def to_parquet(self, path: str | os.PathLike[str]) -> Path:
        """Write the data frame to a Parquet file.

        Parameters
        ----------
        path : path-like
            The file. It is replaced only when the new one is complete.

        Returns
        -------
        pathlib.Path
            The file written.

        Raises
        ------
        ParameterError
            pandas or pyarrow is not installed.
        DataError
            The file cannot be written.
        """
        check_parquet()
        with replacing(path) as temporary:
            self.to_frame().to_parquet(temporary, engine="pyarrow", index=False)
        return Path(path)


def size_of(campaign: Campaign) -> str:
    """Count records, models and tasks in words."""
    counts = {"record": len(campaign.records), "model": len(campaign.models), "task": len(campaign)}
    words = [f"{n} {word}" if n == 1 else f"{n} {word}s" for word, n in counts.items()]
    failed = [f"{len(campaign.failed)} without a model"] if campaign.failed else []
    return ", ".join([*words, *failed])


def check_parquet() -> None:
    """Refuse to write a Parquet file where a package for it is missing.

    Raises
    ------
    ParameterError
        pandas or pyarrow is not installed.
    """
    try:
        import pandas  # noqa: F401
        import pyarrow  # noqa: F401
    except ImportError as error:
        raise ParameterError(f"to_parquet needs {error.name}: expected it installed") from None
