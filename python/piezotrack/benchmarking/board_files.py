"""The folder of a benchmark: one file for each result, kept from run to run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .._support.files.json_text import parse_json
from .._support.files.writing import make_folder, write_document
from ..errors import DataError
from .scoring import FORMAT, SCHEMA_VERSION

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from .contender import Contender
    from .record import BenchmarkRecord

__all__ = ["BoardFolder"]

RESULTS = "results"


class BoardFolder:
    """The folder of a benchmark.

    Parameters
    ----------
    folder : pathlib.Path
        It may exist.

    Raises
    ------
    DataError
        It cannot be made.
    """

    def __init__(self, folder: Path) -> None:
        self.path = make_folder(make_folder(folder) / RESULTS)

    def file(self, record: BenchmarkRecord, contender: Contender) -> Path:
        """Return the file of a result."""
        return self.path / f"{record.name}--{contender.name}.json"

    def result(self, record: BenchmarkRecord, contender: Contender) -> dict[str, Any] | None:
        """Read a result.

        Parameters
        ----------
        record : BenchmarkRecord
            The record.
        contender : Contender
            The contender.

        Returns
        -------
        dict or None
            The content of its file; None where there is none, a damaged one, or that of a record
            with other samples.

        Raises
        ------
        DataError
            The file cannot be read.
        """
        file = self.file(record, contender)
        try:
            content = file.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            raise DataError(f"{file} cannot be read: {reason}") from None
        try:
            document = parse_json(file.name, content)
        except DataError:
            # Nobody but a failing disk or an editor has written that: it is computed again.
            return None
        same = (
            isinstance(document, dict)
            and document.get("format") == FORMAT
            and document.get("schema_version") == SCHEMA_VERSION
            and isinstance(document.get("record"), dict)
            and document["record"].get("key") == record.key
            and (document.get("error") is not None or isinstance(document.get("parts"), list))
        )
        return document if same else None

    def store(
        self, record: BenchmarkRecord, contender: Contender, document: Mapping[str, Any]
    ) -> None:
        """Write a result, whole or not at all."""
        write_document(self.file(record, contender), document)
