"""Output of a command: words, one JSON document, or nothing, and where it writes."""

from __future__ import annotations

import json as json_text
import os
import re
import sys
import textwrap
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Any, Literal

from ..errors import ParameterError, PiezotrackError
from .advice import as_options
from .command import Option, group
from .process.terminal import one_line

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping
    from contextlib import AbstractContextManager

    from .._support.display.look import Style

__all__ = ["OUT", "Output", "Printing", "can_be_folder", "print_words", "wrapped"]

# Names of the option of the folder, in every command that has it.
OUT = ("--out", "-o")
# Formats of pictures.
FORMATS = ("png", "svg", "pdf")
# Lines that a command prints at most without -v.
MOST_LINES = 25
# Endings by which --out is a file.
ENDINGS = re.compile(
    r"\.(csv|npz|mat|parquet|json|png|svg|pdf|html|xlsx?|txt|docx?|h5|tdms|jpe?g|tiff?|eps|md|c|py)"
)

# Columns that lines have at most and at least where they are wrapped, and what is before a note.
WIDEST, NARROWEST, NOTE = 100, 40, "note  "
# Rows of tables and commands stay as they are.
KEPT = re.compile(r" *(?:piezotrack |.*\S {2,}\S)")


@group
class Printing:
    """Output."""

    verbose: Annotated[bool, Option("Print all lines", names=("--verbose", "-v"))] = False
    json: Annotated[bool, Option("Print one JSON document")] = False
    quiet: Annotated[bool, Option("Print errors only")] = False

    def __post_init__(self) -> None:
        if self.json and self.quiet:
            raise ParameterError("--json and --quiet: expected one of them at most, both are given")

    @property
    def progress(self) -> bool:
        """Whether a long search shows its progress, on stderr."""
        return not self.quiet

    def show(
        self,
        words: str,
        document: Mapping[str, Any],
        written: Iterable[Path] | None = None,
        *,
        brief: str | None = None,
    ) -> None:
        """Print the results."""
        files = list(written or ())
        if self.json:
            from .._support.files.writing import json_ready

            names = {} if written is None else {"written": [str(path) for path in files]}
            print(json_text.dumps(json_ready({**document, **names}), indent=2, allow_nan=False))
        elif not self.quiet:
            text = words if self.verbose else _shortened(words, brief or words, MOST_LINES)
            print_words("\n".join([text, *_listed(files)]))


@group
class Output(Printing):
    """Output."""

    out: Annotated[
        Path,
        Option(
            "Folder for the results, or a file for that of its ending",
            metavar="PATH",
            names=OUT,
        ),
    ] = Path("results")
    overwrite: Annotated[bool, Option("Replace results that exist")] = False
    format: Annotated[
        list[Literal["png", "svg", "pdf"]] | None,
        Option("Format of pictures; default png and svg. Repeatable"),
    ] = None
    width: Annotated[
        str | None, Option("Pictures for a paper, this wide, as 85mm", metavar="WIDTH")
    ] = None

    @property
    def formats(self) -> tuple[str, ...]:
        """Endings of pictures: that of the file to write, those given, or the usual ones."""
        ending = self.out.suffix.lower().removeprefix(".")
        if self.is_file and ending in FORMATS:
            return (ending,)
        return tuple(self.format or FORMATS[:2])

    @property
    def is_file(self) -> bool:
        """Whether one file is to be written."""
        return ENDINGS.fullmatch(self.out.suffix.lower()) is not None and not self.out.is_dir()

    @property
    def folder(self) -> Path:
        """Folder of the results."""
        return self.out.parent if self.is_file else self.out

    def will_write(self, names: Iterable[str]) -> None:
        """Refuse a folder that cannot be written to, or results that exist."""
        # Checked before the computation.
        with self._style():
            names = list(dict.fromkeys(one for name in names for one in self._formatted(name)))
        if self.is_file:
            endings = list(dict.fromkeys(Path(name).suffix for name in names))
            if self.out.suffix.lower() not in endings:
                raise ParameterError(
                    "--out", self.out, f"a folder, or a file ending in {', '.join(endings)}"
                )
            names = [self.out.name]
        can_be_folder(self.folder)
        for path in [] if self.overwrite else [self.folder / name for name in names]:
            if path.exists():
                raise ParameterError(f"{path} exists: expected --overwrite, or another --out")

    def write(self, save: Callable[[Path], Iterable[Path]], main: str = "") -> list[Path]:
        """Write the results, or the one that the ending of a file chooses."""
        import shutil

        from .._support.files.writing import make_folder, replacing

        made = not self.folder.exists()
        folder = make_folder(self.folder)
        if not self.is_file:
            try:
                with self._style():
                    return list(save(folder))
            except PiezotrackError:
                # A folder with nothing in it is no result.
                if made:
                    with suppress(OSError):
                        folder.rmdir()
                raise
        with TemporaryDirectory() as place, self._style():
            ending = self.out.suffix.lower()
            found = sorted(save(Path(place)), key=lambda path: path.name != main)
            one = next(path for path in found if path.suffix == ending)
            with replacing(self.out) as temporary:
                shutil.copyfile(one, temporary)
        return [self.out]

    def _style(self) -> AbstractContextManager[None]:
        """Draw and save pictures as the options say."""
        from .._support.display.look import looking

        style: Style | None = None if self.width is None else "paper"
        return looking(style, self.width, self.formats)

    def _formatted(self, name: str) -> list[str]:
        """Return the files that a picture becomes, of its usual formats."""
        stem, dot, ending = name.rpartition(".")
        return [f"{stem}{dot}{one}" for one in self.formats] if ending in FORMATS else [name]


def can_be_folder(out: Path) -> None:
    """Refuse a folder that cannot be written to before the computation begins."""
    there = out
    try:
        while not there.exists() and there != there.parent:
            there = there.parent
        is_folder = there.is_dir()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise ParameterError(f"--out: {out} cannot be made a folder: {reason}") from None
    if not is_folder:
        raise ParameterError(f"--out: {out} cannot be made a folder: {there} is a file")
    if not os.access(there, os.W_OK | os.X_OK):
        raise ParameterError(f"--out: {there} cannot be written to: permission denied")


def _listed(files: list[Path]) -> list[str]:
    """Say which files were written: a line for each folder, endings behind each name."""
    lines = []
    for folder in dict.fromkeys(path.parent for path in files):
        endings: dict[str, list[str]] = {}
        for path in files:
            if path.parent == folder:
                endings.setdefault(path.stem, []).append(path.suffix)
        names = ", ".join(one_line(stem + " ".join(kinds)) for stem, kinds in endings.items())
        place = "" if folder == Path() else f" to {one_line(str(folder))}/"
        lines.append(f"written{place}: {names}")
    return ["", *lines] if lines else []


def _shortened(words: str, brief: str, most: int) -> str:
    """Return the brief words; after a number of lines that are not empty rows are left out."""
    lines, filled = [], 0
    for line in brief.split("\n"):
        # What is not a row of a table stays.
        filled += bool(line)
        if filled <= most or line.startswith("  piezotrack ") or line[:1] not in ("", " "):
            lines.append(line)
    more = len(words.split("\n")) - len(lines)
    return "\n".join([*lines, f"... {more} more lines with -v"] if more > 0 else lines)


def print_words(words: str) -> None:
    """Print lines for a person, in the options of the command and as wide as the terminal.

    Where the output is no terminal, and ``COLUMNS`` is not set, each line stays whole.
    """
    print(wrapped(as_options(words), _columns()), flush=True)


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
