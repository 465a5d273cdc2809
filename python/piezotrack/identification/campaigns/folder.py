"""The folder of a campaign: a document that names it, and one file for each task."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.files.json_text import parse_json
from ..._support.files.writing import json_ready, make_folder, write_document
from ..._support.messages import listed, quoted
from ...errors import DataError, ParameterError
from ..fitted.model_entries import FORMAT as MODEL
from .task import FAILURE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from ...data.dataset import Dataset

__all__ = ["NAME", "CampaignFolder"]

NAME = "campaign.json"
FORMAT = "piezotrack-campaign"
SCHEMA_VERSION = 2


class CampaignFolder:
    """The folder of a campaign, which need not exist yet.

    Parameters
    ----------
    folder : path-like
        The folder.

    Raises
    ------
    ParameterError
        `folder` is no path.
    DataError
        The folder has other files, or the document of a newer version, or cannot be read.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        if not isinstance(folder, (str, os.PathLike)) or not os.fspath(folder):
            raise ParameterError("folder", quoted(folder), "the name of a folder")
        self.path = Path(folder)
        self.document = self._document()

    def _document(self) -> dict[str, Any]:
        """Read the document that names the campaign; empty where there is no campaign yet."""
        try:
            if not self.path.exists():
                return {}
            names = sorted(one for one in os.listdir(self.path) if not one.startswith("."))
            if NAME not in names:
                if names:
                    raise DataError(
                        f"folder {self.path} has {listed(names[:3])} and no {NAME}: expected an "
                        "empty folder, a new one, or that of a campaign"
                    )
                return {}
            content = (self.path / NAME).read_bytes()
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise DataError(f"folder {self.path} cannot be read: {reason}") from None
        document = parse_json(str(self.path / NAME), content)
        if not isinstance(document, dict) or document.get("format") != FORMAT:
            raise DataError(
                f"{self.path / NAME} is not that of a campaign: its 'format' is not '{FORMAT}'"
            )
        if (version := document.get("schema_version")) != SCHEMA_VERSION or version is True:
            raise DataError(
                f"{self.path / NAME} has schema_version {quoted(version)}: this version of "
                f"piezotrack reads {SCHEMA_VERSION}"
            )
        if not all(isinstance(document.get(name), dict) for name in ("records", "models")):
            raise DataError(f"{self.path / NAME}: an entry is not of the form that is written")
        return document

    def begin(
        self, records: Mapping[str, tuple[str, Dataset]], models: Mapping[str, dict[str, Any]]
    ) -> None:
        """Write what the campaign is about, with what it was about before.

        Parameters
        ----------
        records : mapping of str to (str, Dataset)
            Title and record by the hash of the record.
        models : mapping of str to dict
            Settings by the title of the model.

        Raises
        ------
        DataError
            The folder is that of another campaign, which has none of these records or other
            settings under the title of a model; or it cannot be written to.
        """
        known, titled = self.document.get("records", {}), self.document.get("models", {})
        if known and not known.keys() & records.keys():
            titles = [one.get("title") if isinstance(one, dict) else None for one in known.values()]
            raise DataError(
                f"folder {self.path} is that of another campaign, of the records "
                f"{listed(titles[:3])}{', ...' if len(titles) > 3 else ''}, none of which is "
                "given: expected another folder, or one of these records too"
            )
        for title, settings in models.items():
            if titled.get(title, settings) not in (settings, json_ready(settings)) and any(
                document["format"] == MODEL and document["campaign"].get("model") == title
                for document in self.results()
            ):
                raise DataError(
                    f"folder {self.path} has the model '{title}' with other settings, "
                    f"{quoted(titled[title])}: expected another folder, or another title"
                )
        new = {
            key: {
                "title": title,
                "sha256": data.sha256,
                "samples": len(data),
                "window_s": [float(data.t[0]), float(data.t[-1])],
                "hold": data.hold,
                "drive_unit": data.drive_unit,
            }
            for key, (title, data) in records.items()
        }
        document = json_ready(
            {
                "format": FORMAT,
                "schema_version": SCHEMA_VERSION,
                "version": _core.__version__,
                "records": {**known, **new},
                "models": {**titled, **models},
            }
        )
        if document != self.document:
            write_document(make_folder(self.path) / NAME, document)
            self.document = document

    def file(self, task: str) -> Path:
        """Return the file of a task."""
        return self.path / f"{task}.json"

    def result(self, task: str) -> dict[str, Any] | None:
        """Read the result of a task.

        Parameters
        ----------
        task : str
            Its name.

        Returns
        -------
        dict or None
            The content of its file; None where there is none, or another or a damaged one.
        """
        try:
            content = self.file(task).read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise DataError(f"{self.file(task)} cannot be read: {reason}") from None
        try:
            document = parse_json(self.file(task).name, content)
        except DataError:
            # Nobody but a failing disk or an editor has written that: it is computed again.
            return None
        if not isinstance(document, dict) or document.get("format") not in (MODEL, FAILURE):
            return None
        entry = document.get("campaign")
        return document if isinstance(entry, dict) and entry.get("task") == task else None

    def results(self) -> Iterable[dict[str, Any]]:
        """Read the results of all tasks, the oldest file first."""
        files = [one for one in self.path.glob("*.json") if one.name != NAME]
        for file in sorted(files, key=lambda one: (one.stat().st_mtime_ns, one.name)):
            if (found := self.result(file.stem)) is not None:
                yield found

    def store(self, document: Mapping[str, Any]) -> None:
        """Write the result of a task, whole or not at all."""
        write_document(self.file(document["campaign"]["task"]), document)
