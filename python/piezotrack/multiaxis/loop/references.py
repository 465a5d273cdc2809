"""References of several axes as text or file: a column of each, a path, or a text of each."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from ..._support.units import lookup
from ...data.columns import TO_FOLLOW
from ...data.reader import Log
from ...errors import PiezotrackError, ShapeError
from ...references.parse import PATHS, parse_path, reference_of
from ...references.reference import read_reference

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...references.reference import Reference

    Array = NDArray[np.float64]

__all__ = ["BETWEEN", "sampled_references"]

# Mark between the texts of axes.
BETWEEN = ";"


def sampled_references(
    given: str | os.PathLike[str],
    axes: int,
    dt: float,
    *,
    duration: float | None = None,
    period: float | None = None,
) -> Array:
    """Read or parse the references of several axes, and sample them.

    Parameters
    ----------
    given : str or path-like
        A file with a displacement column of each axis, in their order, those called reference
        before others; the text of a path, for two axes, as of `parse_path`, about 0; or texts as
        of `parse_reference` divided by ``;``, an empty one for an axis that stays at 0.
    axes : int
        Number of axes.
    dt : float
        Sampling interval [s].
    duration, period : float, optional
        As of `references.reference_of` [s].

    Returns
    -------
    ndarray, shape (samples, axes)
        Displacements [m].

    Raises
    ------
    ShapeError
        There are references of another number of axes, or of unequal lengths.
    DataError
        The file cannot be read or used.
    ParameterError
        A text cannot be parsed, or `period` is given with a text.

    Examples
    --------
    >>> sampled_references("sine:5Hz,0..2um,200ms;", 2, 0.05).round(9).tolist()
    [[0.0, 0.0], [1e-06, 0.0], [2e-06, 0.0], [1e-06, 0.0]]
    """
    text = os.fspath(given)
    if os.path.isfile(text):
        found: list[Reference | None] = list(_columns(text, axes, duration, period))
    elif text.partition(":")[0].strip().lower() in PATHS:
        _check_count(2, axes)
        path = parse_path(text, duration=duration, centre=(0.0, 0.0), origin=(0.0, 0.0))
        found = [path.x, path.y]
    else:
        parts = [part.strip() for part in text.split(BETWEEN)]
        if any(parts):
            _check_count(len(parts), axes)
        # A text of nothing but marks is refused as an empty one is.
        found = [
            reference_of(part, duration=duration, period=period) if part or not any(parts) else None
            for part in parts
        ]
    samples = [None if one is None else one.sample(dt).x for one in found]
    counts = {k: one.size for k, one in enumerate(samples) if one is not None}
    longest = max(counts.values())
    for k, count in counts.items():
        if count != longest:
            raise ShapeError(
                "reference",
                f"{count * dt:g} s of axis {k}",
                f"{longest * dt:g} s, as long as the others",
            )
    still = np.zeros(longest)
    return np.stack([still if one is None else one for one in samples], axis=1)


def _columns(file: str, axes: int, duration: float | None, period: float | None) -> list[Reference]:
    """Read the displacement columns of a file, those called reference where there are any."""
    log = Log(file)
    lengths = [
        column
        for column in log.columns
        if (unit := lookup(column.unit)) is not None and unit.quantity == "displacement"
    ]
    named = [column for column in lengths if column.name.lower().split("_")[0] in TO_FOLLOW]
    columns = named or lengths
    try:
        _check_count(len(columns), axes)
    except PiezotrackError as error:
        raise error.of(os.path.basename(file)) from None
    return [
        read_reference(file, displacement=column.index, duration=duration, period=period)
        for column in columns
    ]


def _check_count(found: int, axes: int) -> None:
    """Refuse references of another number of axes."""
    if found != axes:
        raise ShapeError("reference", f"{found} axes" if found != 1 else "1 axis", f"{axes}")
