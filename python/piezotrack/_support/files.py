"""Writing files: whole or not at all."""

from __future__ import annotations

import os
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import DataError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

__all__ = ["replacing", "write_columns"]


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Write to a temporary file beside `path`, which is renamed when all went well.

    Parameters
    ----------
    path : path-like
        The file to write.

    Yields
    ------
    pathlib.Path
        The temporary file, with the same ending.

    Raises
    ------
    DataError
        The folder is missing, or the file cannot be written.
    """
    import tempfile

    file = Path(path)
    try:
        handle, name = tempfile.mkstemp(prefix=".", suffix=file.suffix, dir=file.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            # mkstemp makes files that only their owner can read.
            mask = os.umask(0)
            os.umask(mask)
            temporary.chmod(0o666 & ~mask)
            temporary.replace(file)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise DataError(f"{file} cannot be written: {reason}") from None


def write_columns(path: Path, columns: Mapping[str, np.ndarray]) -> Path:
    """Write columns of numbers as a CSV file with a header.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    columns : mapping of str to ndarray, each of shape (n,)
        By title, with the unit in it.

    Returns
    -------
    pathlib.Path
        The file.
    """
    with replacing(path) as temporary:
        np.savetxt(
            temporary,
            np.column_stack(list(columns.values())),
            delimiter=",",
            fmt="%.10g",
            header=",".join(columns),
            comments="",
        )
    return path
