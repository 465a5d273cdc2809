"""Output of a command: words, one JSON document, or nothing, and where it writes."""

from __future__ import annotations

import json as json_text
from typing import TYPE_CHECKING, Any

from ..errors import ParameterError
from .advice import as_options
from .options import can_be_written, list_files

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

__all__ = ["Output"]


class Output:
    """The options ``--out``, ``--overwrite``, ``--json`` and ``--quiet`` of a command.

    Parameters
    ----------
    out : pathlib.Path
        Folder for the results.
    overwrite : bool
        Whether results that exist are replaced.
    json, quiet : bool
        Whether one JSON document is printed, or nothing.

    Raises
    ------
    ParameterError
        Both `json` and `quiet` are given.
    """

    def __init__(self, out: Path, *, overwrite: bool, json: bool, quiet: bool) -> None:
        if json and quiet:
            raise ParameterError("--json and --quiet: expected one of them at most, both are given")
        self.out = out
        self._overwrite, self._json, self._quiet = overwrite, json, quiet

    @property
    def progress(self) -> bool:
        """Whether a long search shows its progress, on stderr."""
        return not self._quiet

    def will_write(self, names: Iterable[str]) -> None:
        """Refuse a folder that cannot be written to, or results that exist.

        Parameters
        ----------
        names : iterable of str
            The files of this command, without the folder.

        Raises
        ------
        ParameterError
            The folder cannot be made, or one of the files exists and is not to be replaced.
        """
        can_be_written(self.out, names, overwrite=self._overwrite)

    def show(self, words: str, document: Mapping[str, Any], written: Iterable[Path]) -> None:
        """Print the results.

        Parameters
        ----------
        words : str
            For a person.
        document : mapping
            The same for a program: numbers, texts, lists and dicts only.
        written : iterable of pathlib.Path
            The files.
        """
        files = list(written)
        if self._json:
            from .._support.files.writing import json_ready

            whole = json_ready({**document, "written": [str(path) for path in files]})
            print(json_text.dumps(whole, indent=2, allow_nan=False))
        elif not self._quiet:
            print(as_options(words))
            list_files(files)
