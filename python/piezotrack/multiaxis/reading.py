"""`read_axes`: records of several axes from logs, one a realisation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._support.arguments import has_entries, positive
from .._support.messages import quoted
from ..data.reader import read
from ..errors import DataError, ParameterError, PiezotrackError, ShapeError
from ..response.periods import period_of
from .identify import DISTINCT
from .record import MultiAxisRecord

if TYPE_CHECKING:
    import os

    from ..data.dataset import Dataset

__all__ = ["are_axes", "read_axes"]


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
        Logs of any format that `pt.read` takes, each with columns of all drives and displacements;
        or ``.npz`` files of records, as of `MultiAxisRecord.from_npz`.
    drives, displacements : sequence of str or int
        The columns; of records, an array each, in pairs of drives and their displacements.
    period : float, optional
        Period of the drives [s]; found by default. The last whole periods of a log are taken.
    **reading : object
        Other arguments of `pt.read`, as ``dt`` and ``units``; of a record these two alone, with
        the unit of the role ``displacement``, um by default.

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
    records: list[MultiAxisRecord] = []
    for file in files:
        pairs = [(str(drive), str(one)) for drive, one in zip(drives, displacements, strict=False)]
        if not all(are_axes(file, *pair) for pair in pairs):
            records.append(_realisation(file, drives, displacements, given, reading))
            continue
        if len(drives) != len(displacements):
            expected = f"{len(drives)}, one for each of the drives"
            raise ParameterError("displacements", f"{len(displacements)} arrays", expected)
        records += [_record(file, *pair, given, reading) for pair in pairs]
    records.sort(key=lambda one: one.level)
    levels: list[list[MultiAxisRecord]] = [[records[0]]]
    for record in records[1:]:
        if record.level < DISTINCT * levels[-1][0].level:
            levels[-1].append(record)
        else:
            levels.append([record])
    return [MultiAxisRecord.joined(_alike(one)) for one in levels]


def are_axes(file: str | os.PathLike[str], drive: str, displacement: str) -> bool:
    """Whether a file of NumPy has arrays of several axes, or of several realisations, so called.

    Where none is so called, others of realisations count.
    """
    if not str(file).lower().endswith(".npz"):
        return False
    try:
        with np.load(file, allow_pickle=False) as arrays:
            named = [arrays[name].shape for name in (drive, displacement) if name in arrays.files]
            others = [] if named else [arrays[name].shape for name in arrays.files]
    except (OSError, ValueError):
        # What is wrong with it is said where it is read.
        return False
    wide = any(len(shape) == 2 and shape[1] > 1 for shape in named)
    return wide or any(len(shape) > 2 for shape in (*named, *others))


def _record(
    file: str | os.PathLike[str],
    drive: str,
    displacement: str,
    period: float | None,
    reading: dict[str, Any],
) -> MultiAxisRecord:
    """Read a record from a file of NumPy, and divide it by its period."""
    units = reading.get("units", {})
    unknown = [name for name in reading if name not in ("dt", "units")]
    unknown += [name for name in units if name not in ("displacement", displacement)]
    if unknown:
        raise ParameterError(
            unknown[0], f"given for {Path(file).name}", "dt and the unit of the displacement alone"
        )
    unit = units.get("displacement", units.get(displacement, "um"))
    name = Path(file).name
    try:
        record = MultiAxisRecord.from_npz(
            file,
            drive=drive,
            output=displacement,
            dt=reading.get("dt"),
            output_unit=unit,
            source=name,
        )
    except ShapeError as error:
        raise error.of(name) from None
    if period is None:
        return record
    if record.u.shape[3] > 1:
        raise ParameterError("period", f"given for {name}", "none, as its arrays have periods")
    count = round(record.samples * record.dt / period)
    if count < 1 or count * round(period / record.dt) != record.samples:
        raise ParameterError(
            "period",
            f"{period:g} s",
            f"a time of which the {record.samples * record.dt:g} s of {name} are a multiple",
        )
    u, y = (np.moveaxis(one[..., 0], 0, -1) for one in (record.u, record.y))
    u, y = (np.moveaxis(one.reshape(*one.shape[:2], count, -1), -1, 0) for one in (u, y))
    return MultiAxisRecord(
        u=u, y=y, dt=record.dt, output_unit=record.output_unit, source=record.source
    )


def _alike(level: list[MultiAxisRecord]) -> list[MultiAxisRecord]:
    """Return the records of a level, each with as many periods as the shortest."""
    fewest = min(one.u.shape[3] for one in level)
    return [
        MultiAxisRecord(
            u=one.u[..., -fewest:],
            y=one.y[..., -fewest:],
            dt=one.dt,
            drive_unit=one.drive_unit,
            output_unit=one.output_unit,
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
    if not any(counts):
        raise DataError(f"{name}: no period was found in any drive: period= gives it")
    if len(set(counts)) > 1 or counts[0] is None:
        known = ", ".join("none" if one is None else f"{one * log.dt:.6g} s" for one in counts)
        raise DataError(
            f"{name}: the drives have periods of {known}: expected one in all; period= gives it"
        )
    return counts[0]
