"""The result of a comparison of controllers: its table and its picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure, SubFigure

    from ..controller import Controller
    from ..tuning.margins import Margins

__all__ = ["Cell", "ControllerComparison", "Row"]


class Cell(NamedTuple):
    """A controller along one reference, once it has settled.

    Attributes
    ----------
    rms, largest : float
        True error [m]; infinite where the loop diverged.
    effort : float
        Change of the command from sample to sample, rms [V].
    clipped : float
        Share of the samples at which the command was clipped.
    """

    rms: float
    largest: float
    effort: float
    clipped: float


class Row(NamedTuple):
    """A controller.

    Attributes
    ----------
    name : str
        Which one.
    controller : Controller
        As it was tuned; for the first reference that it follows where they differ.
    cells : tuple of tuple of (Cell or None)
        For each variant of the stage its figures along each reference; None where it cannot follow
        that, as a motion that does not repeat.
    sensitivity, gain_margin : float or None
        Over the set of plants; None without feedback.
    step_time : float
        Of a step of the controller [s], measured here, without its feedforward.
    """

    name: str
    controller: Controller
    cells: tuple[tuple[Cell | None, ...], ...]
    sensitivity: float | None
    gain_margin: float | None
    step_time: float

    def rms(self, variant: int = 0) -> float:
        """Rms error over the references that it follows.

        Parameters
        ----------
        variant : int, optional
            Which stage, a place in `ControllerComparison.variants`.

        Returns
        -------
        float
            Root of the mean square over the references [m]; NaN where it follows none.
        """
        found = [one.rms for one in self.cells[variant] if one is not None]
        return math.sqrt(sum(one**2 for one in found) / len(found)) if found else math.nan


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ControllerComparison:
    """Controllers side by side; printed, a table.

    Attributes
    ----------
    rows : tuple of Row
        The controllers.
    references, variants : tuple of str
        What was followed, and on which stages.
    refused : mapping of str to str
        Controllers that could not be made, and why.
    dt : float
        Sampling interval [s].
    margins : Margins
        What every feedback keeps.
    """

    rows: tuple[Row, ...]
    references: tuple[str, ...]
    variants: tuple[str, ...]
    refused: Mapping[str, str]
    dt: float
    margins: Margins

    def __repr__(self) -> str:
        return f"<ControllerComparison of {len(self.rows)} controllers>"

    def __str__(self) -> str:
        width = max(len(row.name) for row in self.rows)
        head = "".join(f"{_short(name):>13}" for name in self.references)
        lines = [
            f"true rms error in nm at {1.0 / self.dt:.6g} Hz",
            f"{'':{width}}{head}{'effort mV':>11}{'Ms':>6}{'gain m.':>8}{'step ns':>9}",
        ]
        for row in self.rows:
            cells = "".join(f"{_nanometres(one):>13}" for one in row.cells[0])
            efforts = [one.effort for one in row.cells[0] if one is not None]
            effort = 1e3 * max(efforts)
            lines.append(
                f"{row.name:{width}}{cells}{effort:>11.3g}{_number(row.sensitivity):>6}"
                f"{_number(row.gain_margin):>8}{1e9 * row.step_time:>9.0f}"
            )
        lines += ["", "over all references, nm rms", f"{'':{width}}"]
        lines[-1] += "".join(f"{name:>22}" for name in self.variants)
        for row in self.rows:
            found = "".join(f"{_finite(row.rms(i)):>22}" for i in range(len(self.variants)))
            lines.append(f"{row.name:{width}}{found}")
        lines += [f"not made: {name}: {why}" for name, why in self.refused.items()]
        return "\n".join(lines)

    def document(self) -> dict[str, Any]:
        """Content of a JSON file, SI.

        Returns
        -------
        dict
            Numbers, strings, lists and dicts only.
        """
        return {
            "format": "piezotrack-controller-comparison",
            "schema_version": 1,
            "dt": {"value": self.dt, "unit": "s"},
            "references": list(self.references),
            "variants": list(self.variants),
            "unit": "errors in m, effort in V, times in s; null where a loop diverged",
            "controllers": [
                {
                    "name": row.name,
                    "sensitivity": row.sensitivity,
                    "gain_margin": _finite_or_none(row.gain_margin),
                    "step_time": row.step_time,
                    "figures": [
                        [
                            None
                            if one is None
                            else {name: _finite_or_none(v) for name, v in one._asdict().items()}
                            for one in variant
                        ]
                        for variant in row.cells
                    ],
                }
                for row in self.rows
            ],
            "refused": dict(self.refused),
        }

    def plot(self, *, fig: Figure | SubFigure | None = None) -> Figure:
        """Errors of each controller as tuned, and what becomes of them on other stages.

        Parameters
        ----------
        fig : matplotlib.figure.Figure or SubFigure, optional
            Where to draw; a new figure of pyplot where not given.

        Returns
        -------
        matplotlib.figure.Figure
            The figure drawn in; ``plt.show()`` shows it, a notebook shows it by itself.
        """
        from .comparison_plot import plot_controllers

        return plot_controllers(self, fig)


def _short(name: str) -> str:
    return name if len(name) <= 12 else name[:11] + "."


def _nanometres(one: Cell | None) -> str:
    return "-" if one is None else _finite(one.rms)


def _finite(value: float) -> str:
    return f"{1e9 * value:.4g}" if math.isfinite(value) else "unstable"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}" if math.isfinite(value) else "inf"


def _finite_or_none(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
