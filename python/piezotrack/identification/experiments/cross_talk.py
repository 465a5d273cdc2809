"""Cross-talk between two axes, identified from two logs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ..._support.messages import quoted
from ...data.dataset import Dataset
from ...errors import DataError, ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["CrossTalk", "identify_cross_talk"]

# A drive whose range is below this share of the other's counts as held.
HELD = 0.01


@dataclass(frozen=True, kw_only=True, eq=False)
class CrossTalk:
    """Cross-talk of two axes: position = matrix @ displacements of the axes by their own drives.

    Attributes
    ----------
    matrix : ndarray, shape (2, 2)
        With 1 on its diagonal; ``matrix[0, 1]`` is the share of y in x.
    sd : ndarray, shape (2, 2)
        Standard deviations of its entries, 0 on the diagonal.
    residual : (float, float)
        Rms residual of the fit in x, while y is driven, and in y [m].
    """

    matrix: Array
    sd: Array
    residual: tuple[float, float]

    def __str__(self) -> str:
        entries = (("of y in x", 0, 1), ("of x in y", 1, 0))
        return ", ".join(
            f"{100.0 * self.matrix[i, j]:.3f} +- {100.0 * self.sd[i, j]:.3f} % {what}"
            for what, i, j in entries
        )


def identify_cross_talk(x_driven: Sequence[Dataset], y_driven: Sequence[Dataset]) -> CrossTalk:
    r"""Identify the cross-talk from two logs, in each of which one axis is driven.

    The axis that is held shows a share of the driven one, and its own creep:

    .. math:: y = c_{yx} x + o_0 + o_1 t + o_2 t^2 + o_3 t^3

    by least squares, and the same of x on y from the second log. The standard deviation accounts
    for correlated residuals (Bartlett 1935, doi 10.2307/2342284).

    Parameters
    ----------
    x_driven, y_driven : (Dataset, Dataset)
        Logs of x and y of one experiment each, as `XYStage.record` returns them; the drive of the
        other axis is constant. Their windows are used.

    Returns
    -------
    CrossTalk
        The matrix, to pass to ``contour(decoupling=...)``.

    Raises
    ------
    ParameterError
        An argument is not a pair of Datasets.
    DataError, ShapeError
        The wrong axis is driven, or the logs of one experiment differ in length.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.XYStage.xu_li_2010(seed=1)
    >>> u = 37.5 * (1.0 - np.cos(2.0 * np.pi * 0.25 * np.arange(4000) / 1000.0))
    >>> held = np.zeros(4000)
    >>> records = stage.record(u, held, 1e-3), stage.record(held, u, 1e-3)
    >>> found = pt.identification.identify_cross_talk(*records)
    >>> print(f"{100.0 * found.matrix[0, 1]:.1f} % of y in x")
    1.5 % of y in x
    """
    matrix, sd, residual = np.eye(2), np.zeros((2, 2)), [0.0, 0.0]
    for name, logs, driven in (("x_driven", x_driven, 0), ("y_driven", y_driven, 1)):
        given = isinstance(logs, (tuple, list))
        pair = [log for log in logs if isinstance(log, Dataset)] if given else []
        if len(pair) != 2 or len(logs) != 2:
            raise ParameterError(name, quoted(logs), "the two pt.Dataset of x and y")
        other = 1 - driven
        moving, still = float(np.ptp(pair[driven].u)), float(np.ptp(pair[other].u))
        if still > HELD * moving:
            raise DataError(
                f"{name}: the drive of {'xy'[other]} moves by {still:g} {pair[other].drive_unit} "
                f"while that of {'xy'[driven]} moves by {moving:g}: expected it to be held"
            )
        share, deviation, left = _core.cross_talk_share(pair[driven].y, pair[other].y)
        matrix[other, driven], sd[other, driven], residual[other] = share, deviation, left
    return CrossTalk(matrix=matrix, sd=sd, residual=(residual[0], residual[1]))
