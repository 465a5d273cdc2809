"""References in the plane for an XY stage: one reference for each axis."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .._support.arrays import real_array
from .._support.messages import quoted
from .._support.units import best_length_unit
from ..errors import DataError, ParameterError, ShapeError
from .reference import Reference, read_reference

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

    from .motions import Motion

    Array = NDArray[np.float64]

__all__ = ["XYReference", "read_path"]

# Tolerance of the outline [m], far below the resolution of any sensor.
SAGITTA = 1e-10
COARSE, FINEST = 2000, 400_000
# Position of a stage before a path, and the time from there to the path [s]: 100 um at 94 um/s
# at most, for a stage with a time constant of 0.1 s.
HOME = (0.0, 0.0)
START = 2.0


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class XYReference:
    """A path in the plane as a function of time: one `Reference` for each axis.

    `circle`, `lissajous`, `raster`, `spiral` and `read_path` make them.

    Parameters
    ----------
    name : str
        Name for titles.
    x, y : Reference
        The motion of each axis, of the same duration, period and smooth start.
    radius : float, optional
        Of a counter-clockwise circle [m]; its contour error is then radial.
    centre : (float, float), optional
        Centre of that circle [m].

    Raises
    ------
    ParameterError
        The axes differ in duration, period or smooth start.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.circle(frequency=0.1, radius=10e-6)
    XYReference(circle 10 um, 0.1 Hz, 48.5 to 68.5 by 48.5 to 68.5 um, 30 s)
    """

    name: str
    x: Reference
    y: Reference
    radius: float | None = None
    centre: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for name, axis in (("x", self.x), ("y", self.y)):
            if not isinstance(axis, Reference):
                raise ParameterError(name, type(axis).__name__, "pt.Reference")
        for name in ("duration", "period", "ramp"):
            of_x, other = getattr(self.x, name), getattr(self.y, name)
            if of_x != other:
                raise ParameterError(
                    f"{name} of y", f"{other} s", f"that of x, {of_x} s, as both are one path"
                )
        if (self.radius is None) != (self.centre is None):
            raise ParameterError("radius or centre", "missing", "both of a circle, or neither")

    def __repr__(self) -> str:
        size = max(abs(edge) for axis in self.axes for edge in (axis.low, axis.high))
        unit, scale = best_length_unit(size)
        sides = " by ".join(f"{scale * a.low:.4g} to {scale * a.high:.4g}" for a in self.axes)
        return f"XYReference({self.name}, {sides} {unit}, {self.duration:.6g} s)"

    @property
    def axes(self) -> tuple[Reference, Reference]:
        """The references of x and y."""
        return self.x, self.y

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.x.duration

    @property
    def period(self) -> float | None:
        """Time after which the path repeats [s]; None where it does not."""
        return self.x.period

    @cached_property
    def outline(self) -> tuple[Array, Array]:
        """Points of the path, without its smooth start [m]: chords are within 0.1 nm of it."""
        length = min(self.duration, self.period or math.inf)
        t = np.linspace(0.0, length, COARSE)
        bend = max(float(np.hypot(*(axis._finite(t, 0.0)[2] for axis in self.axes)).max()), 1e-30)
        count = length / math.sqrt(8.0 * SAGITTA / bend)
        t = np.linspace(0.0, length, int(min(max(count, COARSE), FINEST)) + 1)
        return self.x._finite(t, 0.0)[0], self.y._finite(t, 0.0)[0]

    def errors(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Contour error: signed distance of points from the path.

        Parameters
        ----------
        x, y : array_like, shape (n,)
            Points [m].

        Returns
        -------
        ndarray, shape (n,)
            Distance from the nearest point of the path [m], positive to the left of its
            direction. Of a circle it is R - r, as in Table 2 of Xu and Li 2010, doi
            10.1115/1.4001712.

        Examples
        --------
        >>> import piezotrack as pt
        >>> path = pt.circle(frequency=0.1, radius=10e-6, centre=(0.0, 0.0))
        >>> print(f"{1e6 * path.errors([9e-6], [0.0])[0]:.3f} um")
        1.000 um
        """
        if self.radius is not None and self.centre is not None:
            return _core.circle_errors(x, y, self.centre, self.radius)
        return _core.path_errors(x, y, *self.outline)

    def transformed(
        self, matrix: ArrayLike, about: tuple[float, float] = (0.0, 0.0)
    ) -> XYReference:
        """Multiply the axes by a matrix, as for a decoupled feedforward.

        Parameters
        ----------
        matrix : array_like, shape (2, 2)
            The new x is its first row times (x, y), the new y its second.
        about : (float, float), optional
            Point that stays where it is [m].

        Returns
        -------
        XYReference
            With its exact derivatives, and the same smooth start.

        Raises
        ------
        ParameterError
            The matrix is not 2 by 2 or not finite, or the path is not finite behind it.

        Examples
        --------
        >>> import piezotrack as pt
        >>> path = pt.circle(frequency=0.1, radius=10e-6, centre=(0.0, 0.0))
        >>> swapped = path.transformed([[0, 1], [1, 0]])
        >>> bool(swapped.x.at(5.0)[0] == path.y.at(5.0)[0])
        True
        """
        rows = square_matrix("matrix", matrix)
        with np.errstate(over="ignore", invalid="ignore"):
            return self._multiplied(rows, np.array(about) - rows @ np.array(about))

    def _multiplied(self, rows: Array, shift: Array) -> XYReference:
        """Multiply the axes by a matrix, and move them."""
        starts = [
            float(axis.motion(np.zeros(1))[0][0]) if axis.origin is None else axis.origin
            for axis in self.axes
        ]
        edges = np.array([[axis.low, axis.high] for axis in self.axes])
        mixed = []
        for row, axis, more in zip(rows, self.axes, shift, strict=True):
            # The range of a sum lies within the sum of the ranges.
            reach = np.sort(row[:, None] * edges, axis=1).sum(axis=0) + more
            origin = float(row @ starts + more)
            if not np.isfinite([*reach, origin]).all():
                expected = "numbers with which the path stays finite"
                raise ParameterError("matrix", quoted(rows.tolist()), expected)
            mixed.append(
                replace(
                    axis,
                    name=f"{axis.name}, mixed",
                    motion=_mixed(row, float(more), self.x.motion, self.y.motion),
                    low=float(reach[0]),
                    high=float(reach[1]),
                    shortest=max(axis.shortest for axis in self.axes),
                    origin=origin,
                )
            )
        return XYReference(name=f"{self.name}, mixed", x=mixed[0], y=mixed[1])


def _mixed(row: Array, shift: float, x: Motion, y: Motion) -> Motion:
    def motion(t: Array) -> tuple[Array, Array, Array]:
        parts = zip(x(t), y(t), strict=True)
        place, speed, bend = (row[0] * one + row[1] * other for one, other in parts)
        return place + shift, speed, bend

    return motion


def square_matrix(name: str, matrix: ArrayLike) -> Array:
    """Return a finite matrix of two rows and columns, or raise ParameterError."""
    try:
        rows = np.array(real_array(name, matrix))
    except (DataError, ShapeError):
        rows = np.zeros(0)
    if rows.shape != (2, 2) or not np.isfinite(rows).all():
        raise ParameterError(name, quoted(matrix), "2 by 2 finite numbers")
    return rows


def read_path(
    path: str | os.PathLike[str],
    *,
    x: str | int = "x",
    y: str | int = "y",
    time: str | int | None = None,
    units: Mapping[str | int, str] | None = None,
    dt: float | None = None,
    period: float | None = None,
    duration: float | None = None,
    ramp: float | None = None,
    origin: tuple[float, float] | None = HOME,
) -> XYReference:
    r"""Read a path from a text file with a time and two displacements.

    Parameters
    ----------
    path, time, units, dt
        As in `read`.
    x, y : str or int, optional
        The columns of the axes, by title or number.
    period, duration
        As in `Reference.from_samples`.
    ramp : float, optional
        Length of the smooth start [s]. The default is 2 s for a path that repeats, and 0 for one
        that does not, which would lose its beginning: let it begin at the origin.
    origin : (float, float) or None, optional
        Position from which a smooth start begins [m]; None for the first point.

    Returns
    -------
    XYReference
        Through all samples, with the name of the file.

    Raises
    ------
    DataError
        The file cannot be read or used. The message begins with the file's name and the line.
    ParameterError
        An argument names a column that is not there or has a value that cannot be used.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import piezotrack as pt
    >>> folder = tempfile.TemporaryDirectory()
    >>> file = pathlib.Path(folder.name, "parabola.csv")
    >>> lines = [f"{k / 50},{k / 4},{k * k / 100}" for k in range(101)]
    >>> _ = file.write_text("\n".join(["time_s,x_um,y_um", *lines]))
    >>> pt.references.read_path(file)
    XYReference(parabola.csv, 0 to 25.25 by 0 to 102 um, 2.02 s)
    >>> folder.cleanup()
    """
    starts = (None, None) if origin is None else origin
    if ramp is None:
        ramp = 0.0 if period is None else min(START, duration or period)
    axes = [
        replace(
            read_reference(
                path,
                time=time,
                displacement=column,
                units=units,
                dt=dt,
                period=period,
                duration=duration,
                ramp=ramp,
            ),
            origin=start,
        )
        for column, start in zip((x, y), starts, strict=True)
    ]
    return XYReference(name=axes[0].name, x=axes[0], y=axes[1])
