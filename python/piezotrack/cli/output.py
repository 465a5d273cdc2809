"""Output of a command: words, one JSON document, or nothing, and where it writes."""

from __future__ import annotations

import json as json_text
import os
import re
import sys
import textwrap
from typing import TYPE_CHECKING, Any

from ..errors import ParameterError
from .advice import as_options
from .options import can_be_written, list_files

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

__all__ = ["Output", "print_words", "wrapped"]

# Columns that lines have at most and at least where they are wrapped, and what is before a note.
WIDEST, NARROWEST, NOTE = 100, 40, "note  "
# Rows of tables and commands stay as they are.
KEPT = re.compile(r" *(?:piezotrack |.*\S {2,}\S)")


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
            print_words(words)
            list_files(files)


def print_words(words: str) -> None:
    """Print lines for a person, in the options of the command and as wide as the terminal.

    Where the output is no terminal, and ``COLUMNS`` is not set, each line stays whole.

    Parameters
    ----------
    words : str
        One line or several.
    """
    print(wrapped(as_options(words), _columns()))


def wrapped(words: str, columns: int | None) -> str:
    """Break the sentences among some lines, indented from the second line on.

    Parameters
    ----------
    words : str
        One line or several; rows of tables and commands are not broken.
    columns : int or None
        Width of the terminal; None where lines stay whole.

    Returns
    -------
    str
        With at most 100 columns where a sentence has blanks to break at.

    Examples
    --------
    >>> print(wrapped("note  the drive goes from 0 to 90 V, that of the record to 75 V", 40))
    note  the drive goes from 0 to 90 V,
          that of the record to 75 V
    """
    if columns is None:
        return words
    width = min(max(columns, NARROWEST), WIDEST)
    return "\n".join(line for text in words.split("\n") for line in _broken(text, width))


def _broken(line: str, width: int) -> list[str]:
    head, indent = "", re.match(" *", line)[0] + "  "  # type: ignore[index]
    if line.startswith(NOTE):
        head, indent = NOTE, " " * len(NOTE)
    elif KEPT.match(line):
        return [line]
    if len(line) <= width:
        return [line]
    # A number stays with its unit.
    joined = re.sub(r"(?<=\d) (?=%|\w)", "\0", line[len(head) :])
    lines = textwrap.wrap(
        joined,
        width,
        initial_indent=head,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
        expand_tabs=False,
        replace_whitespace=False,
    )
    return [one.replace("\0", " ") for one in lines]


def _columns() -> int | None:
    """Width of the terminal; None where the output is none."""
    given = os.environ.get("COLUMNS", "")
    if given.isdecimal() and int(given) > 0:
        return int(given)
    try:
        return os.get_terminal_size(sys.stdout.fileno()).columns or None
    except (OSError, ValueError, AttributeError):
        return None
