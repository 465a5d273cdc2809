"""Limits of an output: what every adapter checks before it sends a voltage."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._support.arguments import finite
from ..errors import DeviceError, ParameterError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

__all__ = ["check_within", "ordered"]


def ordered(name: str, pair: tuple[float, float]) -> tuple[float, float]:
    """Return two voltages [V], the lower one first.

    Raises
    ------
    ParameterError
        They are not numbers, or the first is not below the second.

    Examples
    --------
    >>> ordered("limits", (0, 75))
    (0.0, 75.0)
    """
    low, high = (finite(name, one, "V") for one in pair)
    if not low < high:
        raise ParameterError(name, f"{low:g} to {high:g} V", "the lower one first")
    return low, high


def check_within(volts: ArrayLike, limits: tuple[float, float], where: str) -> None:
    """Raise DeviceError where a voltage is beyond the limits of an output.

    Parameters
    ----------
    volts : array_like
        One voltage or a table [V].
    limits : (float, float)
        Lowest and highest voltage [V].
    where : str
        The output, for the message.

    Raises
    ------
    DeviceError
        A voltage is beyond them, or no number.

    Examples
    --------
    >>> check_within([0.0, 80.0], (0.0, 75.0), "Dev1/ao0")
    Traceback (most recent call last):
        ...
    piezotrack.errors.DeviceError: volts is 80 V at sample 1: Dev1/ao0 puts out 0 to 75 V
    """
    low, high = limits
    table = np.atleast_1d(np.asarray(volts, dtype=float))
    beyond = np.flatnonzero(~((table >= low) & (table <= high)))
    if beyond.size:
        k = int(beyond[0])
        raise DeviceError(
            f"volts is {table[k]:g} V at sample {k}: {where} puts out {low:g} to {high:g} V"
        )
