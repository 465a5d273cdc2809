"""Atomic writing of files (CSV, JSON, pictures), and their folder."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import DataError
from ..arguments import expect
from ..display.look import look, without_glyph_warnings
from .sets import MARKER, current_set, finish_others, result_set
from .temporary import create, forget

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

__all__ = [
    "document_text",
    "json_ready",
    "make_folder",
    "picture_files",
    "replacing",
    "result_set",
    "save_figures",
    "write_columns",
    "write_document",
    "write_result",
]


@contextmanager
def replacing(path: str | os.PathLike[str], *, synced: bool = False) -> Iterator[Path]:
    """Write to a temporary file beside `path`, which is renamed on success.

    Within `result_set` it is renamed at the end of that.

    Parameters
    ----------
    path : path-like
        The file to write.
    synced : bool, optional
        Whether to wait until the disk has the content, for files that take long to compute.

    Yields
    ------
    pathlib.Path
        The temporary file, with the same ending.

    Raises
    ------
    DataError
        The folder is missing, or the file cannot be written.
    """
    expect("path", path, (str, os.PathLike), "the name of a file")
    file = Path(path)
    if file.name == MARKER:
        raise DataError(f"{file}: expected another name, as this one lists unfinished results")
    results = current_set(file.parent)
    try:
        if results is None:
            finish_others(file.parent)
        temporary = create(file.parent, file.suffix)
        try:
            yield temporary
            if synced:
                with temporary.open("rb+") as content:
                    os.fsync(content.fileno())
            if results is None:
                temporary.replace(file)
            else:
                results.add(temporary, file)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        finally:
            if results is None:
                forget(temporary)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise DataError(f"{file} cannot be written: {reason}") from None


def write_columns(path: str | os.PathLike[str], columns: Mapping[str, np.ndarray]) -> Path:
    """Write columns of numbers as a CSV file with a header.

    Parameters
    ----------
    path : path-like
        The file.
    columns : mapping of str to ndarray, each of shape (n,)
        By title, with the unit in it.

    Returns
    -------
    pathlib.Path
        The file.
    """
    # NumPy opens a name only where there is a working folder.
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        np.savetxt(
            file,
            np.column_stack(list(columns.values())),
            delimiter=",",
            fmt="%.10g",
            header=",".join(columns),
            comments="",
        )
    return Path(path)


def write_document(path: str | os.PathLike[str], document: Mapping[str, Any]) -> Path:
    """Write a JSON file, whole or not at all; arguments and errors as of `save`."""
    text = document_text(document)
    with replacing(path, synced=True) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return Path(path)


def document_text(document: Mapping[str, Any]) -> str:
    """Write the content of a JSON file."""
    import json

    return json.dumps(json_ready(document), indent=2, allow_nan=False) + "\n"


def make_folder(folder: str | os.PathLike[str]) -> Path:
    """Make the folder for results.

    Parameters
    ----------
    folder : path-like
        It may exist.

    Returns
    -------
    pathlib.Path
        The folder.

    Raises
    ------
    DataError
        It cannot be made.
    """
    expect("folder", folder, (str, os.PathLike), "the name of a folder")
    path = Path(folder)
    if not os.fspath(folder):
        raise DataError(
            "the folder for results is '': expected a name, or . for the working folder"
        )
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise DataError(f"{path} cannot be made a folder: {reason}") from None
    return path


def picture_files(*names: str) -> list[str]:
    """Return the names of the files that `save_figures` writes.

    Parameters
    ----------
    *names : str
        Names of the figures.

    Returns
    -------
    list of str
        With their endings.
    """
    return [f"{name}.{ending}" for name in names for ending in look().formats]


def save_figures(figures: Mapping[str, Figure], folder: Path) -> list[Path]:
    """Save figures in the formats of `figure_style`, and close them.

    Parameters
    ----------
    figures : mapping of str to matplotlib.figure.Figure
        By the name of the file, without its ending.
    folder : pathlib.Path
        Folder of the files.

    Returns
    -------
    list of pathlib.Path
        The files written.
    """
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    written = []
    try:
        with result_set(folder), without_glyph_warnings():
            for name, figure in figures.items():
                for file in picture_files(name):
                    path = folder / file
                    # Without a date and with fixed ids, the same result gives the same file.
                    dates: dict[str, dict[str, Any]] = {
                        ".svg": {"Date": None},
                        ".pdf": {"CreationDate": None},
                    }
                    settings: Any = {"svg.hashsalt": name, "pdf.fonttype": 42}
                    with replacing(path) as temporary, mpl.rc_context(settings):
                        stamp = dates.get(path.suffix, {})
                        figure.savefig(temporary, dpi=look().dots, metadata=stamp)
                    written.append(path)
    finally:
        for figure in figures.values():
            plt.close(figure)
    return written


def json_ready(value: Any) -> Any:
    """Replace NaN and infinity, which JSON does not have, by null.

    Parameters
    ----------
    value : object
        Numbers, texts, lists, tuples and mappings.

    Returns
    -------
    object
        The same, with None in their place.
    """
    if isinstance(value, Mapping):
        return {key: json_ready(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [json_ready(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def write_result(
    folder: str | os.PathLike[str],
    name: str,
    document: Mapping[str, Any],
    figure: Figure,
    columns: Mapping[str, np.ndarray] | None = None,
) -> list[Path]:
    """Write the files of a result to a folder, which is made, in one go.

    Parameters
    ----------
    folder : path-like
        The folder.
    name : str
        Of all files, without ending.
    document : mapping
        Content of the JSON file.
    figure : matplotlib.figure.Figure
        The picture.
    columns : mapping of str to ndarray, optional
        Content of a CSV file.

    Returns
    -------
    list of pathlib.Path
        The CSV file if there is one, the JSON file, the picture.

    Raises
    ------
    DataError
        The folder cannot be made or written to.
    """
    with result_set(make_folder(folder)) as path:
        tables = [] if columns is None else [write_columns(path / f"{name}.csv", columns)]
        return [
            *tables,
            write_document(path / f"{name}.json", document),
            *save_figures({name: figure}, path),
        ]
