"""Missing readings of a record: refused, left out, or filled."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from .._support.messages import quoted
from ..errors import DataError, ParameterError
from .far_readings import bridged

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]
    Missing = Literal["drop", "fill"] | None

__all__ = ["USE_MISSING", "Missing", "checked_missing", "complete", "thinned"]

USE_MISSING = "; missing='drop' leaves such readings out, missing='fill' interpolates"


class Complete(NamedTuple):
    """Signals with a number at each sample.

    Attributes
    ----------
    u, y : ndarray, shape (n,)
        Drive and displacement.
    left_out : ndarray of bool, shape (n,), or None
        Where the displacement does not count; None where all of it does.
    notes : list of str
        What was missing.
    """

    u: Array
    y: Array
    left_out: Mask | None
    notes: list[str]


def checked_missing(missing: object) -> Missing:
    """Check what is to become of missing readings.

    Parameters
    ----------
    missing : object
        Argument of the caller.

    Returns
    -------
    {"drop", "fill"} or None
        None to refuse them.

    Raises
    ------
    ParameterError
        It is something else.
    """
    if missing is None or (isinstance(missing, str) and missing in ("drop", "fill")):
        return missing  # type: ignore[return-value]
    raise ParameterError(
        f"missing is {quoted(missing)}: expected 'drop', 'fill' or None", argument="missing"
    )


def complete(u: Array, y: Array, missing: Missing, *, constant: bool) -> Complete:
    """Put numbers where readings are missing.

    The samples stay, because the stage goes on through what was not read and its hysteresis and
    creep remember it. The drive there is the straight line between the samples beside the gap, or
    the last sample before it where it is constant between samples.

    Parameters
    ----------
    u, y : ndarray, shape (n,)
        Drive and displacement, NaN where they are missing.
    missing : {"drop", "fill"} or None
        Whether the displacement counts there. None leaves the signals as they are.
    constant : bool
        Whether the drive is constant between samples.

    Returns
    -------
    Complete
        The signals.

    Raises
    ------
    DataError
        More than half of the readings of a signal are missing.
    """
    lost = {"drive": np.isnan(u), "displacement": np.isnan(y)}
    without = lost["drive"] | lost["displacement"]
    if missing is None or not without.any():
        return Complete(u, y, None, [])
    for name, mask in lost.items():
        if 2 * int(mask.sum()) > mask.size:
            raise DataError(
                f"{int(mask.sum())} of {mask.size} readings of the {name} are missing: expected "
                "less than half"
            )
    does = "they do not count" if missing == "drop" else "straight lines are in their place"
    notes = [
        f"{int(mask.sum())} of {mask.size} readings of the {name} are missing: {does}"
        for name, mask in lost.items()
        if mask.any()
    ]
    drive = _held(u, lost["drive"]) if constant else bridged(u, lost["drive"])
    if missing == "fill":
        return Complete(drive, bridged(y, lost["displacement"]), None, notes)
    # Under a drive that is not known, the displacement tells nothing.
    return Complete(drive, bridged(y, without), without, notes)


def _held(u: Array, lost: Mask) -> Array:
    """Put the last sample before in place of those that are lost."""
    known = np.flatnonzero(~lost)
    before = np.searchsorted(known, np.arange(u.size), side="right") - 1
    held: Array = u[known[np.maximum(before, 0)]]
    return held


def thinned(left_out: Mask | None, factor: int, first: int) -> Mask | None:
    """Find the samples that do not count at a lower rate: those around which none did.

    Parameters
    ----------
    left_out : ndarray of bool, shape (n,), or None
        Those at the rate of before.
    factor : int
        How many samples become one.
    first : int
        The first that stays.

    Returns
    -------
    ndarray of bool or None
        None where all count.
    """
    if left_out is None:
        return None
    counts = np.convolve(left_out, np.ones(factor), mode="same") >= factor - 0.5
    kept: Mask = counts[first::factor]
    return kept if kept.any() else None
