"""`read_axes`: records of several axes from logs, one a realisation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._support.arguments import has_entries, positive
from .._support.messages import quoted
from ..data.reader import read
from ..errors import DataError, ParameterError, PiezotrackError
from ..response.periods import period_of
from .identify import DISTINCT
from .record import MultiAxisRecord

if TYPE_CHECKING:
    import os

    from ..data.dataset import Dataset

__all__ = ["read_axes"]


def read_axes(
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    drives: Sequence[str | int],
    displacements: Sequence[str | int],
    period: float | None = None,
    **reading: Any,
) -> list[MultiAxisRecord]:
    """Read logs of several axes in steady state, each a realisation of periodic drives.

    Parameters
    ----------
    paths : path-like or sequence of path-like
        Logs of any format that `pt.read` takes, each with columns of all drives and displacements.
    drives, displacements : sequence of str or int
        The columns.
    period : float, optional
        Period of the drives [s]; found by default. The last whole periods of a log are taken.
    **reading : object
        Other arguments of `pt.read`, as ``dt`` and ``units``.

    Returns
    -------
    list of MultiAxisRecord
        One for each level of the drives, rising: logs of one level are its realisations.

    Raises
    ------
    DataError
        A log cannot be read, or its drives do not repeat.
    ParameterError
        A column is not there, or logs of one level have different periods or intervals.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> record = pt.multiaxis.VirtualAxes.three(noise=1e-9).record(samples=64, realisations=3)
    >>> titles = "time_s,a_V,b_V,c_V,x_um,y_um,z_um"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     paths = [pathlib.Path(folder, f"{k}.csv") for k in range(3)]
    ...     for k, path in enumerate(paths):
    ...         both = np.concatenate([record.u, 1e6 * record.y], axis=1)[:, :, k]
    ...         times = record.dt * np.arange(128)
    ...         rows = np.column_stack([times, np.vstack([both[..., 0], both[..., 1]])])
    ...         np.savetxt(path, rows, delimiter=",", comments="", header=titles)
    ...     pt.multiaxis.read_axes(paths, drives="abc", displacements="xyz")
    [<MultiAxisRecord: 3 drives, 3 sensors, 3 realisations of 2 x 64 samples, 1 V rms>]
    """
    files: list[Any] = list(paths) if has_entries(paths) else [paths]
    for name, columns in (("drives", drives), ("displacements", displacements)):
        if not isinstance(columns, Sequence) or not columns:
            raise ParameterError(name, quoted(columns), "titles or numbers of columns")
    if not files:
        raise ParameterError("paths", "an empty list", "a log or more")
    given = None if period is None else positive("period", period, "s")
    records = sorted(
        (_realisation(file, drives, displacements, given, reading) for file in files),
        key=lambda one: one.level,
    )
    levels: list[list[MultiAxisRecord]] = [[records[0]]]
    for record in records[1:]:
        if record.level < DISTINCT * levels[-1][0].level:
            levels[-1].append(record)
        else:
            levels.append([record])
    return [MultiAxisRecord.joined(_alike(one)) for one in levels]


def _alike(level: list[MultiAxisRecord]) -> list[MultiAxisRecord]:
    """Return the records of a level, each with as many periods as the shortest."""
    fewest = min(one.u.shape[3] for one in level)
    return [
        MultiAxisRecord(
            u=one.u[..., -fewest:],
            y=one.y[..., -fewest:],
            dt=one.dt,
            drive_unit=one.drive_unit,
            source=one.source,
        )
        for one in level
    ]


def _realisation(
    file: str | os.PathLike[str],
    drives: Sequence[str | int],
    displacements: Sequence[str | int],
    period: float | None,
    reading: dict[str, Any],
) -> MultiAxisRecord:
    """Read one log as whole periods."""
    # A log is read by pairs of columns, as many as there are of the more.
    pairs = [
        read(
            file,
            drive=drives[min(k, len(drives) - 1)],
            displacement=displacements[min(k, len(displacements) - 1)],
            **reading,
        )
        for k in range(max(len(drives), len(displacements)))
    ]
    name = Path(file).name
    first = pairs[0]
    try:
        counts = [period_of(one, period) for one in pairs[: len(drives)]]
    except PiezotrackError as error:
        raise error.of(name) from None
    count = _common(name, counts, first)
    whole = len(first) // count
    u, y = (
        np.stack([getattr(one, signal)[-whole * count :] for one in pairs[:channels]], axis=1)
        for signal, channels in (("u", len(drives)), ("y", len(displacements)))
    )
    try:
        return MultiAxisRecord(
            u=u, y=y, dt=first.dt, periods=whole, drive_unit=first.drive_unit, source=name
        )
    except PiezotrackError as error:
        raise error.of(name) from None


def _common(name: str, counts: list[int | None], log: Dataset) -> int:
    """Return the samples of the period that all drives have."""
    if len(set(counts)) > 1 or counts[0] is None:
        known = ", ".join("none" if one is None else f"{one * log.dt:.6g} s" for one in counts)
        raise DataError(
            f"{name}: the drives have periods of {known}: expected one in all; period= gives it"
        )
    return counts[0]
