"""Settings of an identification by least squares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from ... import _core
from ..._support.arguments import as_numbers
from ..._support.messages import quoted
from ...errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["LeastSquares"]

MOST_PLAYS, MOST_ZONES = 32, 8


@dataclass(frozen=True, kw_only=True)
class LeastSquares:
    """Settings of an identification by least squares.

    The weights of plays, dead zones and creep and the offset are found by the Gauss-Newton method,
    each step of which is a non-negative least-squares problem (Lawson and Hanson 1974); without
    dead zones and creep a single step solves the problem, as in Kuhnen 2003, doi
    10.3166/ejc.9.407-418. Weights of dead zones stay between -0.5 and 1, the creep below half of
    the displacement. The frequency and damping of a mode start from a grid and are found along
    with the weights. By default plays, creep and dynamics are those that the record shows; each
    has to lower the deviation by 1.5 to 3 % to be taken. Nothing is random.

    Parameters
    ----------
    count : int, optional
        Number of plays, 1 to 32, with thresholds spread evenly up to half of the drive's range.
        None: 20, or 10 with fewer than 800 samples; others where they foretell a third of the
        window better that was left out: up to 32, or fewer about which the weights of these gather.
        Of a model with levels the number of intervals between them, 1 to 16; None: 6, or 12.
    thresholds : sequence of float, optional
        Thresholds of the plays [V], in place of `count`.
    levels : sequence of float, optional
        Levels [V] of a model that has them, in place of `count`.
    dead_zones : bool or int, optional
        Number of one-sided dead zones, 0 to 8, spread evenly over the displacement; True stands
        for 2, or for none where the model has no dead zones.
    creep : {"auto"} or bool or sequence of float, optional
        Time constants of the creep [s]; True stands for the powers of ten between five samples
        and half of the window. ``"auto"``: two a decade apart, where the record shows them.
    dynamics : {"auto", "first", "second"} or None, optional
        ``"first"``: a first-order lag, which also approximates a delayed reading. ``"second"``: a
        mode, of at least three cycles in the window and at most 0.75 cycles a sample. None:
        neither. ``"auto"``: a mode where the record shows one, else the smallest lag that
        explains it within 1 %, which may be none.

    Raises
    ------
    ParameterError
        A setting is out of its range.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6]
    ... )
    >>> u = 37.5 * (1 - np.cos(np.arange(2000) / 100.0))
    >>> log = pt.Dataset(u=u, y=stage.simulate(u, 0.01).x, dt=0.01)
    >>> method = pt.LeastSquares(thresholds=[5.0, 10.0, 20.0], dead_zones=False, dynamics=None)
    >>> fit = pt.identify(log, "prandtl-ishlinskii", method=method)
    >>> print(", ".join(f"{1e6 * weight:.3f}" for weight in fit.model.weights), "um/V")
    0.000, 0.200, 0.100 um/V
    """

    count: int | None = None
    thresholds: Sequence[float] | None = None
    levels: Sequence[float] | None = None
    dead_zones: bool | int = True
    creep: Literal["auto"] | bool | Sequence[float] = "auto"
    dynamics: Literal["auto", "first", "second"] | None = "auto"

    name: ClassVar[str] = "least_squares"

    def __post_init__(self) -> None:
        if self.count is not None:
            count = _core.as_count("count", self.count)
            if not 1 <= count <= MOST_PLAYS:
                raise ParameterError("count", count, f"1 to {MOST_PLAYS} plays")
        if self.thresholds is not None:
            object.__setattr__(self, "thresholds", as_numbers("thresholds", self.thresholds))
        if self.levels is not None:
            object.__setattr__(self, "levels", as_numbers("levels", self.levels))
        if not isinstance(self.dead_zones, bool):
            zones = _core.as_count("dead_zones", self.dead_zones)
            if zones > MOST_ZONES:
                raise ParameterError("dead_zones", zones, f"up to {MOST_ZONES} dead zones")
        automatic = isinstance(self.creep, str) and self.creep == "auto"
        if not isinstance(self.creep, bool) and not automatic:
            object.__setattr__(self, "creep", as_numbers("creep", self.creep))
        words = ("auto", "first", "second")
        named = isinstance(self.dynamics, str) and self.dynamics in words
        if self.dynamics is not None and not named:
            raise ParameterError(
                "dynamics", quoted(self.dynamics), "'auto', None, 'first' or 'second'"
            )

    @property
    def _resumes(self) -> bool:
        """Whether the structure is chosen, and can begin with that of another fit."""
        return self.creep == self.dynamics == "auto"

    def settings(self) -> dict[str, Any]:
        """Return the settings by their names."""
        return dict(vars(self))
