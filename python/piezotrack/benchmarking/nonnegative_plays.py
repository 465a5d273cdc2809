"""The model of a quarter of an hour: plays, a delay, and non-negative least squares."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["nonnegative_plays"]


def nonnegative_plays(u: Array, y: Array, first: int = 0) -> Callable[[Array, float], Array]:
    """Fit 12 plays, three samples late, by ``scipy.optimize.nnls``.

    Parameters
    ----------
    u, y : ndarray, shape (n,)
        Drive [V] and displacement [m].
    first : int, optional
        Sample from which on the displacement counts.

    Returns
    -------
    callable
        ``predict(u, dt) -> x``.
    """
    from scipy.optimize import nnls

    thresholds = np.linspace(0.0, 0.5 * np.ptp(u), 13)[:-1]

    def columns(u: Array) -> Array:
        plays, z = np.empty((u.size, 14)), np.zeros(12)
        for k, volts in enumerate(u):
            z = np.maximum(volts - thresholds, np.minimum(volts + thresholds, z))
            plays[k] = (*z, 1.0, -1.0)
        return np.concatenate([np.repeat(plays[:1], 3, axis=0), plays[:-3]])

    weights, _ = nnls(columns(u)[first:], y[first:])
    return lambda u, _: columns(u) @ weights
