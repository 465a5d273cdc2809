"""Displacement as a sensor shows it whose readings come late."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._support.arrays import LARGEST
from ..errors import NumericalError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .model_info import ModelInfo
    from .motion import Response

    Array = NDArray[np.float64]

__all__ = ["delayed_reading"]


def delayed_reading(info: ModelInfo, run: Response, delay: float) -> Array:
    """Displacement of a stage as it is read a delay later.

    Parameters
    ----------
    info : ModelInfo
        Model of the stage.
    run : Response
        Its motion.
    delay : float
        Delay [s].

    Returns
    -------
    ndarray, shape (n,)
        Displacement [m], below 1e100 m, as the samples of records are; between samples on the
        cubic through displacements and velocities, of a model found by least squares on straight
        lines, as in its fit: without modes it has no velocity.

    Raises
    ------
    NumericalError
        The displacement is larger.
    """
    if (largest := float(np.abs(run.x).max())) >= LARGEST:
        raise NumericalError(
            f"the simulated motion reaches {largest:g} m: check the parameters of the model, in SI"
        )
    if not delay:
        return run.x
    if not info.searched:
        late: Array = np.interp(run.t - delay, run.t, run.x)
        return late
    return _core.delayed(run.x, run.v, float(run.t[1]) if run.t.size > 1 else 1.0, delay)
