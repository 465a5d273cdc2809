"""Writing a record as a text log."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .._support.files import write_columns

if TYPE_CHECKING:
    from pathlib import Path

    from .dataset import Dataset

__all__ = ["write_log"]


def write_log(log: Dataset, path: Path) -> Path:
    """Write a log as a CSV file for `read`.

    Parameters
    ----------
    log : Dataset
        The record; its warm-up is left out.
    path : pathlib.Path
        The file.

    Returns
    -------
    pathlib.Path
        The file.
    """
    return write_columns(
        path, {"time_s": log.t, "voltage_V": log.u, "displacement_um": 1e6 * log.y}
    )
