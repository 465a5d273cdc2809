"""The formats of logs, one file each.

A format is a file in `text` or `binary` with a `Format`, and a line in the list. Its `opens` says
which columns a file has, with the units and the sampling interval that the file states; which
column is what, and what units mean, is decided in `data/columns.py` for all of them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .binary import afm, hdf5, mat, mdf, npz, parquet, tdms, xlsx
from .source import Source
from .text import delimited, gcs, lvm, oscilloscope, waveforms

if TYPE_CHECKING:
    import os

    from .table import Format, Table

__all__ = ["FORMATS", "format_of", "open_log"]

# The first whose first bytes are those of a file, or else that of its ending, or else text.
FORMATS: tuple[Format, ...] = (
    npz.FORMAT,
    npz.NPY,
    mat.FORMAT,
    hdf5.FORMAT,
    parquet.FORMAT,
    tdms.FORMAT,
    mdf.FORMAT,
    afm.FORMAT,
    xlsx.FORMAT,
    gcs.FORMAT,
    lvm.FORMAT,
    waveforms.FORMAT,
    oscilloscope.FORMAT,
    delimited.FORMAT,
)


def format_of(source: Source) -> Format:
    """Return the format of a file, by its first bytes or by the ending of its name.

    Where lines are skipped it is a spreadsheet, or text of columns and no other format of text.
    """
    if source.skip:
        if xlsx.FORMAT.begins(source.head):
            return xlsx.FORMAT
        return delimited.FORMAT
    for known in FORMATS:
        if known.begins(source.head):
            return known
    for known in FORMATS:
        if source.ending in known.endings:
            return known
    return delimited.FORMAT


def open_log(path: str | os.PathLike[str], skip: int = 0) -> Table:
    """Open a log of any format.

    Parameters
    ----------
    path : path-like
        The file.
    skip : int, optional
        Lines or rows at its beginning that are left out.

    Returns
    -------
    Table
        Its columns.

    Raises
    ------
    DataError
        It is not there, damaged, or the library for its format is not installed.
    ParameterError
        `path` is no name of a file.
    """
    source = Source(path, skip)
    if not source.size:
        raise source.error("is empty: expected a log")
    if source.head.lstrip().startswith(b"{") and b'"piezotrack-' in source.head:
        raise source.error("is a file that piezotrack wrote, as a model: expected a log")
    return format_of(source).opens(source)
