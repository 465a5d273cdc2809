"""Table 2 of Xu and Li 2010: circles of three radii at three frequencies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from ..._support.display.result import Result
from ...control.loop.contouring import Contour, contour
from ...references.paths import circle

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike

    from ...control.controller.controller import Controller
    from ...control.timing import Timing
    from ...stages.xy import XYStage

__all__ = ["PUBLISHED", "Table2", "run_table_2"]


class Published(NamedTuple):
    """One case: radius [m], frequency [Hz]; contour error: peak to peak, mean and SD [m]."""

    radius: float
    frequency: float
    peak_to_peak: float
    mean: float
    sd: float

    @property
    def key(self) -> str:
        """Name of the circle in the keys of its numbers."""
        return f"circle.{1e6 * self.radius:g}um.{self.frequency:g}Hz"

    @property
    def ratio(self) -> float:
        """Peak to peak divided by SD."""
        return self.peak_to_peak / self.sd


# Doi 10.1115/1.4001712; printed in um. "Max" is of the peak-to-peak error.
PUBLISHED = tuple(
    Published(radius / 1e6, frequency, peak_to_peak / 1e6, mean / 1e6, sd / 1e6)
    for radius, frequency, peak_to_peak, mean, sd in (
        (10.0, 0.1, 0.957, 0.021, 0.184),
        (10.0, 0.2, 1.406, 0.095, 0.311),
        (10.0, 0.5, 2.606, 0.570, 0.485),
        (20.0, 0.1, 1.499, 0.063, 0.300),
        (20.0, 0.2, 2.250, 0.210, 0.480),
        (20.0, 0.5, 4.118, 1.030, 0.831),
        (40.0, 0.1, 2.347, 0.052, 0.472),
        (40.0, 0.2, 4.152, 0.272, 0.853),
        (40.0, 0.5, 7.048, 1.649, 1.518),
    )
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Table2(Result):
    """The nine circles, run.

    Attributes
    ----------
    runs : tuple of Contour
        In the order of the table: by radius, then by frequency.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "xu_li_2010.views.report_text:table_2_text",
        "plot": "xu_li_2010.views.table_2_plot:plot_table_2",
    }

    runs: tuple[Contour, ...]

    @property
    def cases(self) -> list[tuple[Published, Contour]]:
        """Published values and run of each circle."""
        return list(zip(PUBLISHED, self.runs, strict=False))


def run_table_2(
    stage: XYStage,
    controllers: Sequence[Controller],
    *,
    decoupling: ArrayLike | None = None,
    timing: Timing | None = None,
    largest: float = 1.0,
    checked: bool = True,
) -> Table2:
    """Run the nine circles of Table 2 of Xu and Li 2010, doi 10.1115/1.4001712.

    Three turns each, about the middle of the workspace, scored after the smooth start; the paper
    does not state this. A circle at 0.5 Hz therefore has fewer samples for its extremes.

    Parameters
    ----------
    stage : XYStage
        The plant.
    controllers : (Controller, Controller)
        Of x and y.
    decoupling, timing
        As for `contour`.
    largest : float, optional
        Radius up to which circles are run [m]: 20e-6 leaves out the last three.
    checked : bool, optional
        Whether reach and stability are checked before each circle.

    Returns
    -------
    Table2
        The runs; printed, a table of published and obtained values.

    Raises
    ------
    ParameterError, NumericalError
        As for `contour`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
    >>> table = pt.xu_li_2010.run_table_2(pt.XYStage.xu_li_2010(seed=1), (loop, loop))
    >>> run = table.runs[0]
    >>> print(f"{run.path.name}: SD {1e6 * run.metrics.sd_error:.2f} um, published 0.18 um")
    circle 10 um, 0.1 Hz: SD 0.16 um, published 0.18 um
    """
    return Table2(
        runs=tuple(
            contour(
                stage,
                controllers,
                circle(frequency=case.frequency, radius=case.radius),
                decoupling=decoupling,
                timing=timing,
                beyond_reach=not checked,
                unstable=not checked,
            )
            for case in PUBLISHED
            if case.radius <= largest
        )
    )
