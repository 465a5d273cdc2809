"""Two axes on one platform: an XY stage of two stages, with cross-talk and a lag."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .. import _core
from .._core import XYStage as CoreStage
from .._support.messages import quoted
from ..data.dataset import Dataset
from ..errors import ParameterError
from ..references.xy_reference import square_matrix
from .virtual import VirtualResponse, VirtualStage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from ..data.dataset import Hold

    Array = NDArray[np.float64]

__all__ = ["XYLog", "XYResponse", "XYStage"]


class XYResponse(NamedTuple):
    """Motion of a platform along both axes.

    Attributes
    ----------
    x, y : VirtualResponse
        Motion along each axis; both sensors are read at once.
    """

    x: VirtualResponse
    y: VirtualResponse


class XYLog(NamedTuple):
    """Log of both axes.

    Attributes
    ----------
    x, y : Dataset
        Command and measured displacement of each axis.
    """

    x: Dataset
    y: Dataset


@dataclass(frozen=True, kw_only=True)
class XYStage:
    r"""Two stages that move one platform.

    .. math:: x = d_x + c_{xy} d_y, \qquad y = c_{yx} d_x + d_y

    with :math:`d_x` and :math:`d_y` the displacement of each stage under its own voltage, from the
    zero of its sensor. Sensor readings and true displacements are those of x and y.

    Parameters
    ----------
    x, y : VirtualStage, Stage or IdentifiedModel
        Two of any kind, which are kept as virtual stages: `VirtualStage.of`.
    cross_talk : (float, float) or array_like of shape (2, 2), optional
        Share of y in x and of x in y, or a matrix with 1 on its diagonal.
    lag : float, optional
        Time from sampling x to sampling y [s], with the same point of the path; it may exceed a
        control interval.
    missed_ticks : float, optional
        Chance, 0 to 1, that in a control interval one of the two axes misses its tick: y is then a
        sample of the path further behind x, or one less, with equal chances. Drawn from the seed
        of y, and part of `pt.contour` only.
    most_behind : int, optional
        Most samples of the path by which y falls behind x; it is never ahead.

    Raises
    ------
    ParameterError
        A number is out of its range, or a matrix has something other than 1 on its diagonal.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.XYStage.xu_li_2010(seed=1)
    >>> stage.cross_talk
    (0.015, 0.01)
    >>> along_x, along_y = stage.record([0.0, 0.0, 75.0] * 2, [0.0] * 6, 0.1)
    >>> print(f"{1e6 * along_x.y[2]:.0f} um and {1e6 * along_y.y[2]:.1f} um")
    116 um and 1.2 um
    """

    # Given as a stage of any kind, kept as a VirtualStage.
    x: Any
    y: Any
    cross_talk: tuple[float, float] = (0.0, 0.0)
    lag: float = 0.0
    missed_ticks: float = 0.0
    most_behind: int = 0

    def __post_init__(self) -> None:
        for name in ("x", "y"):
            object.__setattr__(self, name, _virtual(name, getattr(self, name)))
        object.__setattr__(self, "cross_talk", _shares(self.cross_talk))
        object.__setattr__(self, "lag", _core.as_number("lag", self.lag))
        chance = _core.as_number("missed_ticks", self.missed_ticks)
        object.__setattr__(self, "missed_ticks", chance)
        object.__setattr__(self, "most_behind", _core.as_count("most_behind", self.most_behind))
        _ = self._core

    def __getstate__(self) -> dict[str, Any]:
        # Without the cache: the core's stage cannot be pickled.
        return {name: value for name, value in vars(self).items() if name != "_core"}

    @cached_property
    def _core(self) -> CoreStage:
        """The stage in the core, which checks every number."""
        missed = (self.missed_ticks, self.most_behind)
        return CoreStage(self.x._core, self.y._core, self.cross_talk, self.lag, missed)

    @property
    def matrix(self) -> Array:
        """Cross-talk as a matrix with 1 on its diagonal, shape (2, 2)."""
        xy, yx = self.cross_talk
        return np.array([[1.0, xy], [yx, 1.0]])

    @classmethod
    def xu_li_2010(cls, *, seed: int = 0) -> XYStage:
        """Make an XY stage like that of Xu and Li 2010, doi 10.1115/1.4001712.

        Published: a workspace of about 117 um by 117 um, and a cross-talk of at most 1.5 %; x is
        `VirtualStage.xu_li_2010`.

        Chosen, because the paper does not describe y nor the order of sampling: y has 13 %
        hysteresis in place of 10 % and reaches 115 um in place of 117.8 um, as two stacks of one
        batch may differ, and noise of its own; the cross-talk is 1.5 % of y in x and 1 % of x in y;
        the lag is half of the control interval of 0.02 s, as when two axes are sampled in turn.
        None of these was fitted to Table 2; docs/evidence.md shows the effect of lag and
        cross-talk.

        Parameters
        ----------
        seed : int, optional
            Of the sensors' noise.

        Returns
        -------
        XYStage
            Preconditioned, its sensors set to 0 on the settled loops.
        """
        x = VirtualStage.xu_li_2010(seed=seed)
        y = VirtualStage._xu_li_2010_y(seed)
        return cls(x=x, y=y, cross_talk=(0.015, 0.010), lag=0.010)

    def simulate(
        self, ux: ArrayLike, uy: ArrayLike, dt: float, *, hold: Hold = "foh"
    ) -> XYResponse:
        """Motion under two sampled drives.

        Parameters
        ----------
        ux, uy : array_like, shape (n,)
            Command to the amplifier of each axis [V].
        dt : float
            Sampling interval [s].
        hold : {"foh", "zoh"}, optional
            As for `DahlStage.simulate`.

        Returns
        -------
        XYResponse
            Motion of the platform, `x` and `y`; both sensors are read at once.

        Raises
        ------
        ParameterError, ShapeError
            A number is out of its range, or the drives differ in length.
        """
        dt = _core.as_number("dt", dt)
        x, y = (
            VirtualResponse(
                t=np.arange(true.size, dtype=np.float64) * dt,
                u=np.array(u, dtype=np.float64),
                applied=applied,
                x=true,
                y=read,
            )
            for u, (true, read, applied) in zip(
                (ux, uy), self._core.simulate(ux, uy, dt, str(hold)), strict=True
            )
        )
        return XYResponse(x, y)

    def record(self, ux: ArrayLike, uy: ArrayLike, dt: float, *, hold: Hold = "foh") -> XYLog:
        """Record a log of both axes.

        Parameters
        ----------
        ux, uy, dt, hold
            As for `simulate`.

        Returns
        -------
        XYLog
            Command and measured displacement of each axis, `x` and `y`.
        """
        x, y = (
            Dataset(u=run.u, y=run.y, dt=dt, hold=hold, source=f"{axis} of the virtual stage")
            for axis, run in zip("xy", self.simulate(ux, uy, dt, hold=hold), strict=True)
        )
        return XYLog(x, y)


def _virtual(name: str, stage: object) -> VirtualStage:
    """Take a stage of any kind as a virtual stage."""
    if isinstance(stage, VirtualStage):
        return stage
    try:
        return VirtualStage.of(stage)  # type: ignore[arg-type]
    except ParameterError:
        raise ParameterError(
            name,
            type(stage).__name__,
            "an identified model, a stage of a model, as a pt.DahlStage, or a pt.VirtualStage",
        ) from None


def _shares(cross_talk: Sequence[float] | ArrayLike) -> tuple[float, float]:
    """Take two numbers, or the sides of a matrix with 1 on its diagonal."""
    try:
        dimensions = np.ndim(cross_talk)
    except ValueError:
        # Rows of different lengths.
        dimensions = 0
    if dimensions == 2:
        rows = square_matrix("cross_talk", cross_talk)
        if (np.diag(rows) != 1.0).any():
            raise ParameterError(
                "cross_talk",
                f"{rows[0, 0]:g} and {rows[1, 1]:g} on its diagonal",
                "1, as the gains are the stages' own",
                verb="has",
            )
        return float(rows[0, 1]), float(rows[1, 0])
    listed = list(cross_talk) if dimensions == 1 else []  # type: ignore[arg-type]
    if len(listed) != 2:
        raise ParameterError("cross_talk", quoted(cross_talk), "two numbers, or a matrix of 2 by 2")
    xy, yx = (_core.as_number(f"cross_talk[{i}]", one) for i, one in enumerate(listed))
    return xy, yx
