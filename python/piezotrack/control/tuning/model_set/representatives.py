"""The entries of a set that stand for the others: those that are farthest from each other."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .... import _core

    Array = NDArray[np.float64]

__all__ = ["farthest", "responses"]

# Frequencies at which plants are compared, from this share of half the sampling rate on.
FREQUENCIES = 24
LOWEST = 1e-3


def farthest(points: Array, most: int) -> list[int]:
    """Choose points by the rule of Gonzalez, each the farthest from those before.

    Gonzalez 1985, doi 10.1016/0304-3975(85)90224-5: no choice of as many leaves less than half of
    its distance to the farthest point. It begins with the first.

    Parameters
    ----------
    points : ndarray, shape (n, m)
        The points.
    most : int
        How many to take.

    Returns
    -------
    list of int
        Numbers of the points; fewer than `most` where the others lie on them.

    Examples
    --------
    >>> import numpy as np
    >>> farthest(np.array([[0.0], [0.1], [1.0], [0.45]]), 3)
    [0, 2, 3]
    """
    chosen = [0]
    distances = np.linalg.norm(points - points[0], axis=1)
    while len(chosen) < most and distances.max() > 0.0:
        chosen.append(int(distances.argmax()))
        distances = np.minimum(distances, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return chosen


def responses(plants: Sequence[_core.LoopPlant], dt: float) -> Array:
    """Frequency responses of plants relative to the first, as points.

    Parameters
    ----------
    plants : sequence of LoopPlant
        Plants.
    dt : float
        Sampling interval [s].

    Returns
    -------
    ndarray, shape (n, 48)
        Real and imaginary parts, up to half the sampling rate.
    """
    s = np.asarray(1j * math.pi / dt * np.geomspace(LOWEST, 1.0, FREQUENCIES), dtype=np.complex128)
    along = np.array([_response(plant, s) for plant in plants])
    ratio = along / along[0]
    return np.hstack([ratio.real, ratio.imag])


def _response(plant: _core.LoopPlant, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
    rows, b, c, d, delay = plant.matrices()
    direct = d * np.ones_like(s)
    if b:
        a = np.reshape(rows, (len(b), len(b)))
        inside = s[:, None, None] * np.eye(len(b)) - a
        states = np.linalg.solve(inside, np.broadcast_to(np.array(b)[:, None], (s.size, len(b), 1)))
        direct = direct + (states[..., 0] @ np.array(c))
    return np.asarray(direct * np.exp(-s * delay), dtype=np.complex128)
