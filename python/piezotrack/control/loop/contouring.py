"""Contouring: closed-loop simulation of an XY stage along a path, and its contour error."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from ... import _core
from ..._support.arguments import expect, number_pair
from ..._support.display.frames import frame_of
from ..._support.display.result import Panel, Result
from ..._support.files.writing import write_result
from ..._support.statistics import ErrorStatistics
from ..._support.units import drive_word, shown_unit
from ...errors import ParameterError
from ...references.parse import path_of
from ...references.xy_reference import XYReference, square_matrix
from ...stages.xy import XYStage
from ..controller.controller import Controller
from ..plant import displacement_range, initial_displacement, timing_on
from .run import Run

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

    from ..._support.display.look import Style, Width
    from ..timing import Timing
    from .tracking import Tracking

    Array = NDArray[np.float64]

__all__ = ["Contour", "Workspace", "contour", "spread_text", "workspace"]

# Distance of the path's start from the stage that is noted, as a part of the path's size.
JUMP = 0.05


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Contour(Result):
    """A contouring run; printed, its contour error and the metrics of each axis.

    Its picture shows path and positions, the error magnified along the path, and the errors over
    time; each alone, in axes of your own, is a method, as `plot_path`.

    Attributes
    ----------
    path : XYReference
        The path.
    x, y : Tracking
        Each axis as of `track`, with its own metrics: desired, measured and true
        displacement, voltage and its parts. Both sensors are read at the instants ``t``.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "control.views.contouring_text:contour_text",
        "plot": "control.views.contouring_plot:plot_contour",
        "plot_path": "control.views.contouring_plot:plot_path",
        "plot_magnified": "control.views.contouring_plot:plot_magnified",
        "plot_contour_error": "control.views.contouring_plot:plot_contour_error",
    }

    path: XYReference
    x: Tracking
    y: Tracking

    def __repr__(self) -> str:
        return f"<Contour of {self.path!r}: {spread_text(self.metrics)}>"

    @property
    def t(self) -> Array:
        """Time of the control samples of x [s], shape (n,)."""
        return self.x.t

    @property
    def settled(self) -> float:
        """Time from which `metrics` are computed [s].

        As for `Tracking`, but never before the path itself begins: the smooth start has no path
        to compare with.
        """
        ramp = max(self.path.x.ramp, self.path.y.ramp)
        begin = ramp if ramp < self.t[-1] - 1e-9 else 0.0
        return max(self.x.settled, begin)

    @cached_property
    def error(self) -> Array:
        """Contour error of the measured positions [m], shape (n,): see `XYReference.errors`."""
        return self.path.errors(self.x.measured, self.y.measured)

    @cached_property
    def fine_error(self) -> Array:
        """Contour error of the true positions between the samples too [m], at ``x.fine_t``."""
        return self.path.errors(self.x.fine_displacement, self.y.fine_displacement)

    @cached_property
    def metrics(self) -> ErrorStatistics:
        """Statistics of the measured contour error, from `settled` on."""
        return self.score()

    def score(
        self, start: float | None = None, stop: float | None = None, *, true: bool = False
    ) -> ErrorStatistics:
        """Statistics of the contour error in a part of the run.

        Parameters
        ----------
        start, stop : float, optional
            The part [s]; default from `settled` to the end.
        true : bool, optional
            Whether to use the true positions, between the samples too and without noise and
            quantisation of the sensors.

        Returns
        -------
        ErrorStatistics
            Table 2 of Xu and Li 2010 has `peak_to_peak`, `mean_error` and `sd_error`.

        Raises
        ------
        ParameterError
            It has fewer than two samples.
        """
        t, errors = self.t, self.error
        if _core.as_truth("true", true):
            t, errors = self.x.fine_t, self.fine_error
        first = self.settled if start is None else start
        return ErrorStatistics.of(_core.spread(errors[self.x.part(t, first, stop)]))

    @property
    def table(self) -> dict[str, Array]:
        """Columns of the run at the control samples, with their units in the names."""
        table = {"time_s": self.t}
        for name, axis in (("x", self.x), ("y", self.y)):
            unit, scale = shown_unit(axis.controller.drive_unit)
            command = drive_word(axis.controller.drive_unit)
            table |= {
                f"desired_{name}_um": 1e6 * axis.desired,
                f"measured_{name}_um": 1e6 * axis.measured,
                f"{command}_{name}_{unit}": scale * axis.voltage,
            }
        return table | {"contour_error_um": 1e6 * self.error}

    def to_frame(self) -> Any:
        """Return the run as a data frame of pandas.

        Returns
        -------
        pandas.DataFrame
            With the columns of `table`.

        Raises
        ------
        ParameterError
            pandas is not installed.
        """
        return frame_of(self.table)

    @property
    def notes(self) -> list[str]:
        """Notes on the run, such as a path that begins away from the stage."""
        jump = float(np.hypot(self.x.error[0], self.y.error[0]))
        reach = max(float(np.ptp(axis.desired)) for axis in (self.x, self.y))
        if jump <= JUMP * reach:
            return []
        return [
            f"the path begins {1e6 * jump:.3g} um from the stage, which has to jump "
            "there: let the path begin at the origin, (0, 0), or with a smooth start"
        ]

    @property
    def last_turn(self) -> NDArray[np.bool_]:
        """Samples of the last turn, of shape (n,); all settled ones where the path is run once."""
        turn, start = self.path.period, self.settled
        if turn is not None:
            start = max(start, self.t[-1] + self.x.controller.dt - turn)
        last: NDArray[np.bool_] = self.t >= start - 1e-9
        return last

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {
            "format": "piezotrack-contour",
            "schema_version": 1,
            "path": repr(self.path),
            "unit": "errors in m, phase lag in rad, widest loop as a part of the travel",
            "from_s": self.settled,
            "contour": asdict(self.metrics),
            "contour_true": asdict(self.score(true=True)),
            "x": asdict(self.x.metrics),
            "y": asdict(self.y.metrics),
            "feedforward": self.x.note,
            "notes": self.notes,
            "provenance": {"package": "piezotrack", "version": _core.__version__},
        }

    def save(
        self, folder: str | os.PathLike[str], *, entries: Mapping[str, Any] | None = None
    ) -> list[Path]:
        """Write samples, metrics and picture to a folder, in one go.

        Parameters
        ----------
        folder : path-like
            It is made where it does not exist.
        entries : mapping, optional
            More entries of the JSON file, which replace those of `document`.

        Returns
        -------
        list of pathlib.Path
            ``contour.csv``, ``contour.json``, ``contour.png`` and ``.svg``.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        document = self.document() | dict(entries or {})
        return write_result(folder, "contour", document, self.plot(), self.table)

    plot_path = Panel("Plot desired and measured path in the plane.")

    def plot_magnified(
        self,
        *,
        ax: Axes | None = None,
        factor: float | None = None,
        style: Style | None = None,
        width: Width | None = None,
    ) -> Axes:
        """Plot the contour error, magnified, along the path.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw in; default those of a new figure.
        factor : float, optional
            Magnification; default a round number that keeps the errors readable.
        style : {"screen", "paper"}, optional
            As in `piezotrack.figure_style`.
        width : str or float, optional
            Width of a new figure, as ``"85mm"``; a number is in metres.

        Returns
        -------
        matplotlib.axes.Axes
            With the picture.

        Examples
        --------
        >>> from matplotlib.figure import Figure
        >>> import piezotrack as pt
        >>> stage = pt.XYStage.xu_li_2010(seed=1)
        >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
        >>> run = pt.contour(stage, (loop, loop), pt.circle(frequency=0.5, radius=10e-6))
        >>> ax = run.plot_magnified(ax=Figure().subplots())
        >>> ax.get_ylabel()
        'y [µm]'
        """
        axes: Axes = self.view("plot_magnified")(self, ax, factor=factor, style=style, width=width)
        return axes

    plot_contour_error = Panel("Plot the contour error over the last turn.")


def spread_text(spread: ErrorStatistics) -> str:
    """Write peak to peak, mean and standard deviation of a contour error."""
    return (
        f"peak to peak {1e6 * spread.peak_to_peak:.3f} um, mean {1e6 * spread.mean_error:.3f} um, "
        f"SD {1e6 * spread.sd_error:.3f} um"
    )


def contour(
    stage: XYStage,
    controllers: Sequence[Controller],
    path: XYReference | str,
    *,
    decoupling: ArrayLike | None = None,
    timing: Timing | None = None,
    substeps: int = 10,
    beyond_reach: bool = False,
    unstable: bool = False,
) -> Contour:
    """Simulate closed-loop contouring of a path with an XY stage.

    Both axes move in continuous time. At each sampling instant x is read and its voltage applied;
    after the lag of the stage the same is done for y, with the same point of the path. Cross-talk
    couples the loops through their sensors.

    Parameters
    ----------
    stage : XYStage
        The plant.
    controllers : (Controller, Controller)
        Of x and y, with the same sampling interval.
    path : XYReference or str
        The path, as ``pt.circle(...)``; or a text or a file, as the command line takes it:
        ``"circle:0.1Hz,10um"``.
    decoupling : array_like, shape (2, 2), optional
        Cross-talk as of `identification.identify_cross_talk`: the feedforward follows the path
        times its inverse, which cancels the cross-talk.
    timing : Timing, optional
        Delay and jitter of both loops, and the voltages before the run of both axes. The jitter is
        drawn for each axis separately, but is the same for two models, whose sensors have no seed.
    substeps : int, optional
        Instants kept in each sampling interval.
    beyond_reach, unstable : bool, optional
        As for `track`.

    Returns
    -------
    Contour
        The motion and its metrics.

    Raises
    ------
    ParameterError
        A number is out of its range, the path exceeds the reach of a stage, or a loop is unstable.
    NumericalError
        A loop diverges.

    Examples
    --------
    >>> import piezotrack as pt
    >>> loop = pt.Controller(
    ...     dt=0.02,
    ...     limits=(0.0, 75.0),
    ...     feedforward=pt.DahlStage.xu_li_2010().inverse(),
    ...     feedback=pt.Pid.xu_li_2010(),
    ... )
    >>> path = pt.circle(frequency=0.1, radius=10e-6)
    >>> run = pt.contour(pt.XYStage.xu_li_2010(seed=1), (loop, loop), path)
    >>> run.metrics.peak_to_peak < 1.5e-6
    True
    """
    expect("stage", stage, XYStage, "pt.XYStage")
    path = path_of(path)
    both = _two(controllers)
    substeps = _core.as_count("substeps", substeps)
    free = {
        "unstable": _core.as_truth("unstable", unstable),
        "beyond_reach": _core.as_truth("beyond_reach", beyond_reach),
    }
    x, y = _runs(both, path)
    of_x = timing_on(stage.x, timing, x.controller.limits)
    of_y = timing_on(stage.y, timing, y.controller.limits)
    for name, axis, run in (("x", stage.x, x), ("y", stage.y, y)):
        try:
            run.check(axis, of_x.delay, **free)
        except ParameterError as error:
            raise error.of(name) from None
    ahead = x, y
    if decoupling is not None:
        offsets = stage.x.sensor.offset, stage.y.sensor.offset
        ahead = _runs(both, path.transformed(_inverse(decoupling), offsets))
    (volts_x, note_x), (volts_y, note_y) = (run.feedforward for run in ahead)
    tracked_x, tracked_y = stage._core.track(
        (x.controller._core, y.controller._core),
        (x.samples.x, y.samples.x),
        (volts_x, volts_y),
        (of_x, of_y),
        substeps,
    )
    return Contour(
        path=path,
        x=x.collect(tracked_x, note_x, substeps),
        y=y.collect(tracked_y, note_y, substeps),
    )


class Workspace(NamedTuple):
    """Reach of an XY stage.

    Attributes
    ----------
    x, y : (float, float)
        Lowest and highest displacement along each axis [m].
    rest : (float, float)
        Position in which a run begins [m], for the `origin` of a path.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    rest: tuple[float, float]

    @property
    def centre(self) -> tuple[float, float]:
        """The middle [m], for the `centre` of a path."""
        return 0.5 * sum(self.x), 0.5 * sum(self.y)


def workspace(
    stage: XYStage, limits: tuple[float, float] | Sequence[tuple[float, float]]
) -> Workspace:
    """Find what an XY stage reaches between voltage limits.

    Parameters
    ----------
    stage : XYStage
        The stage.
    limits : (float, float) or two of them
        Lowest and highest voltage of both axes [V], or of x and of y.

    Returns
    -------
    Workspace
        Without cross-talk.

    Raises
    ------
    ParameterError
        `stage` is no XY stage, or `limits` are none.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.XYStage(x=pt.DahlStage.xu_li_2010(), y=pt.DahlStage.xu_li_2010())
    >>> middle = pt.control.workspace(stage, (0.0, 75.0)).centre
    >>> print(f"{1e6 * middle[0]:.0f} um")
    60 um
    """
    expect("stage", stage, XYStage, "pt.XYStage")
    alone = np.ndim(limits[0]) == 0
    pairs = [number_pair("limits", one, "V") for one in ([limits] * 2 if alone else limits)]
    axes = list(zip((stage.x, stage.y), pairs, strict=True))
    x, y = (displacement_range(one, pair, 1e-3) for one, pair in axes)
    at_x, at_y = (initial_displacement(one, pair) for one, pair in axes)
    return Workspace(x, y, (at_x, at_y))


def _two(controllers: Sequence[Controller]) -> tuple[Controller, Controller]:
    """Return the controllers of x and y, checked to have the same interval."""
    given = list(controllers) if isinstance(controllers, (tuple, list)) else []
    both = [one for one in given if isinstance(one, Controller)]
    if not len(given) == len(both) == 2:
        kinds = ", ".join(type(one).__name__ for one in given) or type(controllers).__name__
        raise ParameterError("controllers", kinds, "two pt.Controller, for x and y", verb="are")
    x, y = both
    if x.dt != y.dt:
        raise ParameterError("dt of y", f"{y.dt:g} s", f"that of x, {x.dt:g} s")
    return x, y


def _runs(both: tuple[Controller, Controller], path: XYReference) -> tuple[Run, Run]:
    """Return the runs of both axes along a path."""
    x, y = both
    return Run(x, path.x), Run(y, path.y)


def _inverse(matrix: ArrayLike) -> Array:
    rows = square_matrix("decoupling", matrix)
    if abs(float(np.linalg.det(rows))) < 1e-3:
        raise ParameterError("decoupling", rows.tolist(), "a matrix near unity")
    return np.asarray(np.linalg.inv(rows), dtype=np.float64)
