"""The result of a comparison of controllers: its table and its picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import fmean, median, stdev
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from ..._support.display.result import Result
from ..._support.files.writing import write_result
from ..._support.units import decibels

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from ..controller.controller import Controller
    from ..tuning.margins import Margins

__all__ = ["Cell", "ControllerComparison", "Row"]

# Numbers of a cell in a file.
NUMBERS = ("rms", "spread", "largest", "effort", "clipped", "chatter", "settled")


class Cell(NamedTuple):
    """A controller along one reference, once it has settled.

    Attributes
    ----------
    draws : tuple of float
        True rms error with each draw of the sensor's noise [m]; infinite where the loop diverged.
    largest : float
        Largest true error with any of them [m].
    effort : float
        Change of the command from sample to sample, rms [V].
    clipped : float
        Share of the samples at which the command was clipped.
    chatter : float or None
        The part of these changes above a quarter of the sampling rate, rms [V], with the first
        draw; on the stage that the controllers were tuned for only.
    alone : float
        True rms error with the inverse alone along that reference, on the stage that the
        controllers were tuned for [m].
    settled : float or None
        Median time in which the moves of a reference with levels settle to 2 % [s], with the first
        draw, on the stage that the controllers were tuned for; infinite where they do not.
    """

    draws: tuple[float, ...]
    largest: float
    effort: float
    clipped: float
    chatter: float | None
    alone: float
    settled: float | None

    @property
    def rms(self) -> float:
        """True rms error, mean over the draws [m]."""
        return fmean(self.draws)

    @property
    def spread(self) -> float:
        """Sample standard deviation of the draws [m]; NaN of one, or where the loop diverged."""
        if len(self.draws) < 2 or not all(map(math.isfinite, self.draws)):
            return math.nan
        return stdev(self.draws)


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
    searches : tuple of float
        `relative` of the gains that each seed of the search ends with, ascending; those of the
        median are the controller's. One where nothing is searched.
    """

    name: str
    controller: Controller
    cells: tuple[tuple[Cell | None, ...], ...]
    sensitivity: float | None
    gain_margin: float | None
    step_time: float
    searches: tuple[float, ...]

    def relative(self, variant: int = 0) -> float:
        """Error relative to that with the inverse alone, over the references that it follows.

        Parameters
        ----------
        variant : int, optional
            Which stage, a place in `ControllerComparison.variants`; the inverse is on the first.

        Returns
        -------
        float
            Root of the mean square of the ratios, so that no motion decides alone; NaN where it
            follows none.
        """
        followed = [one for one in self.cells[variant] if one is not None]
        if not followed:
            return math.nan
        return math.sqrt(fmean((one.rms / one.alone) ** 2 for one in followed))

    def rms(self, variant: int = 0) -> float:
        """Rms error over the references that it follows, mean over the draws of the noise.

        Parameters
        ----------
        variant : int, optional
            Which stage, a place in `ControllerComparison.variants`.

        Returns
        -------
        float
            Root of the mean square over the references [m]; NaN where it follows none.
        """
        found = [one.draws for one in self.cells[variant] if one is not None]
        draws = [math.sqrt(fmean(one**2 for one in draw)) for draw in zip(*found, strict=True)]
        return fmean(draws) if draws else math.nan

    @property
    def effort(self) -> float:
        """Largest effort along any reference, on the stage that it was tuned for [V]."""
        return max(one.effort for one in self._followed())

    @property
    def chatter(self) -> float | None:
        """Median of the chatter over the references, so that jumps of one do not decide [V]."""
        found = [one.chatter for one in self._followed() if one.chatter is not None]
        return median(found) if found else None

    @property
    def settled(self) -> float | None:
        """Median settling time of the first reference that has levels [s]; None without one."""
        return next((one.settled for one in self._followed() if one.settled is not None), None)

    def _followed(self) -> list[Cell]:
        return [one for one in self.cells[0] if one is not None]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ControllerComparison(Result):
    """Controllers side by side; printed, a table.

    Attributes
    ----------
    rows : tuple of Row
        The controllers.
    references, variants : tuple of str
        Names of the references, and of the stages.
    refused : mapping of str to str
        Controllers that could not be made, and why.
    dt : float
        Sampling interval [s].
    margins : Margins
        Margins that every feedback keeps.
    seeds : int
        Draws of the sensor's noise with which each controller was evaluated.
    searches : int
        Seeds of the search with which each was tuned.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "control.views.comparison_table:comparison_text",
        "html": "control.views.comparison_table:comparison_html",
        "plot": "control.views.comparison_plot:plot_controllers",
    }

    rows: tuple[Row, ...]
    references: tuple[str, ...]
    variants: tuple[str, ...]
    refused: Mapping[str, str]
    dt: float
    margins: Margins
    seeds: int
    searches: int

    def __repr__(self) -> str:
        return f"<ControllerComparison of {len(self.rows)} controllers>"

    def document(self) -> dict[str, Any]:
        """Content of a JSON file, SI; the same for the same comparison.

        Returns
        -------
        dict
            Numbers, strings, lists and dicts only; without the time of a step, which is measured.
        """
        return {
            "format": "piezotrack-controller-comparison",
            "schema_version": 1,
            "dt": {"value": self.dt, "unit": "s"},
            "references": list(self.references),
            "variants": list(self.variants),
            "seeds": self.seeds,
            "searches": self.searches,
            "unit": "errors in m, effort and chatter in V; null where a loop diverged",
            "controllers": [
                {
                    "name": row.name,
                    "sensitivity": row.sensitivity,
                    "gain_margin_dB": _decibels(row.gain_margin),
                    "relative_error": [
                        _finite_or_none(row.relative(i)) for i in range(len(row.cells))
                    ],
                    "relative_error_of_searches": [_finite_or_none(one) for one in row.searches],
                    "figures": [
                        [None if one is None else _figures_of(one) for one in variant]
                        for variant in row.cells
                    ],
                }
                for row in self.rows
            ],
            "refused": dict(self.refused),
        }

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write the figures and the picture to a folder, in one go.

        Parameters
        ----------
        folder : path-like
            It is made where it does not exist.

        Returns
        -------
        list of pathlib.Path
            ``controllers.json``, ``controllers.png`` and ``.svg``.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        return write_result(folder, "controllers", self.document(), self.plot())


def _figures_of(cell: Cell) -> dict[str, Any]:
    values = {"rms": cell.rms, "spread": cell.spread, **cell._asdict()}
    found: dict[str, Any] = {name: _finite_or_none(values[name]) for name in NUMBERS}
    return {**found, "draws": [_finite_or_none(one) for one in cell.draws]}


def _decibels(factor: float | None) -> float | None:
    return _finite_or_none(None if factor is None else decibels(factor))


def _finite_or_none(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
