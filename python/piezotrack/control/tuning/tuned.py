"""Result of a tuning: the controllers, their margins, and the active constraints."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from ... import _core
from ..._support.display.result import Result
from ..._support.files.writing import make_folder, result_set, save_figures, write_document
from ..._support.units import decibels, shown_unit
from ..loop.contouring import Contour
from .structures import gains_of

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from ...references.reference import Reference
    from ...references.xy_reference import XYReference
    from ..controller.controller import Controller
    from ..loop.tracking import Tracking
    from ..parts.part import FeedbackLaw
    from .margins import Margins
    from .model_set.other_kind import OtherKind

__all__ = ["MARGIN_UNITS", "MarginReport", "Tuned", "motion_of", "picture_name"]

# Units in which margins are shown, and the conversions to them.
MARGIN_UNITS: dict[str, tuple[str, Callable[[float], float]]] = {
    "gain margin": ("dB", decibels),
    "phase margin": ("deg", math.degrees),
}


class MarginReport(NamedTuple):
    """A margin over the set of plants.

    Attributes
    ----------
    name : str
        Which margin.
    value : float
        Of the worst plant, exact: a gain margin as a factor, a phase margin in rad.
    bound : float
        The bound, likewise.
    plant : str
        Which plant is the worst.
    """

    name: str
    value: float
    bound: float
    plant: str

    @property
    def share(self) -> float:
        """Share of the bound that is used up: 1 at the bound."""
        if self.name in ("gain margin", "phase margin"):
            return self.bound / self.value if self.value > 0.0 else float("inf")
        return self.value / self.bound

    def __str__(self) -> str:
        side = "at least" if self.name in ("gain margin", "phase margin") else "at most"
        unit, shown = self._shown
        unit = f" {unit}" if unit else ""
        return (
            f"{self.name} {shown(self.value):.3g}{unit} ({side} {shown(self.bound):.3g}{unit}), "
            f"{self.plant}"
        )

    @property
    def _shown(self) -> tuple[str, Callable[[float], float]]:
        return MARGIN_UNITS.get(self.name, ("", float))

    def entry(self) -> dict[str, Any]:
        """Entry of a file, the unit in the name.

        Returns
        -------
        dict
            ``name``, ``value``, ``bound`` and ``plant``; a value without an end is None.
        """
        unit, shown = self._shown
        value = shown(self.value)
        return {
            "name": "_".join([*self.name.split(), *([unit] if unit else [])]),
            "value": value if math.isfinite(value) else None,
            "bound": shown(self.bound),
            "plant": self.plant,
        }


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Tuned(Result):
    """Tuned controllers, with their runs, margins, active constraints and the effort of the search.

    Its picture is the figure that was made small, after each iteration.

    Attributes
    ----------
    controllers : tuple of Controller
        To be used as they are: one, of an XY stage those of x and y for `contour`.
    minimised : str
        The figure that was made small.
    unit : str
        Its unit: ``"m"``, of the effort ``"V"``.
    value : float
        Its value, the largest over the stages tried, whose feedforward is off by ``offset`` of
        `Spread`; without a reference the integral of the error after a step disturbance of 1 V at
        the input of the stage [m s/V].
    runs : tuple of Tracking or of Contour
        Full simulations of the tuned loop on the first stage without an offset, one for each
        reference.
    kept : tuple of MarginReport
        The margins over the set of plants.
    margins : Margins
        The bounds.
    plants : tuple of str
        The plants of the set.
    active_constraints : tuple of str
        What forbids a smaller value: margins and bounds of the goal that are used up, settings at
        the ends of their ranges. Empty where the value has its minimum inside.
    candidates, loops : int
        Controllers evaluated, and closed loops simulated.
    history : tuple of float
        Best figure after each iteration; infinite as long as no candidate kept the margins.
    searches, agreeing : int
        Searches from different sides, and how many of them end within 2 % of the best.
    spread : tuple of float
        By how much each of them ends above the best, as a share of it, the least first; infinite
        where one keeps not what is required. A last search, which begins with all, has the best.
    bandwidths : tuple of (float or None)
        Bandwidth of the feedback of each controller on the stage at its middle gain [Hz], as of
        `check_loop`.
    other_kind : OtherKind or None
        Name of a model of another kind, fitted to the record of the first stage, and the rms error
        that these gains leave on it; None without a record.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "control.views.tuning:tuned_text",
        "plot": "control.views.tuning:plot_tuned",
    }

    controllers: tuple[Controller, ...]
    minimised: str
    value: float
    runs: tuple[Any, ...]
    kept: tuple[MarginReport, ...]
    margins: Margins
    plants: tuple[str, ...]
    active_constraints: tuple[str, ...]
    candidates: int
    loops: int
    history: tuple[float, ...]
    searches: int
    agreeing: int
    spread: tuple[float, ...]
    bandwidths: tuple[float | None, ...]
    unit: str = "m"
    other_kind: OtherKind | None = None

    @property
    def controller(self) -> Controller:
        """The controller; of an XY stage that of x."""
        return self.controllers[0]

    def __repr__(self) -> str:
        return f"<Tuned: {self.minimised}, {len(self.plants)} plants>"

    def design(self) -> dict[str, Any]:
        """Margins for the file of a controller.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {
            "by": "tune",
            "figure": self.minimised,
            f"value_{self.unit}": self.value,
            "plants": list(self.plants),
            "kept": [one.entry() for one in self.kept],
            "bandwidth_Hz": list(self.bandwidths),
            "binding": list(self.active_constraints),
        }

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only: the settings, those of an XY stage under
            ``axes``, and what they keep.
        """
        axes = [_settings(one) for one in self.controllers]
        return {
            "format": "piezotrack-tuning",
            "schema_version": 1,
            **(axes[0] if len(axes) == 1 else {"axes": axes}),
            "unit": "gains in V/m, times in s, frequencies in Hz, errors in m",
            "references": [
                {
                    "reference": repr(motion_of(run)),
                    "metrics": asdict(run.metrics),
                    "true_metrics": asdict(run.score(true=True)),
                }
                for run in self.runs
            ],
            "kept": [one.entry() for one in self.kept],
            "bandwidth_Hz": list(self.bandwidths),
            "plants": list(self.plants),
            "binding": list(self.active_constraints),
            "controllers": self.candidates,
            "loops": self.loops,
            "other_kind": None if self.other_kind is None else self.other_kind._asdict(),
            "searches": self.searches,
            "agreeing": self.agreeing,
            "spread": [one if math.isfinite(one) else None for one in self.spread],
            "provenance": {"package": "piezotrack", "version": _core.__version__},
        }

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write settings, controllers, and a picture of the loop along each reference, in one go.

        Parameters
        ----------
        folder : path-like
            It is made where it does not exist.

        Returns
        -------
        list of pathlib.Path
            ``tuning.json``, ``controller.json`` or ``controller_x.json`` and ``controller_y.json``,
            ``tuned.png`` and ``.svg``, ``tuned_2.png`` and so on.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        ParameterError
            A feedforward is none that a file can hold.
        """
        names = ("controller",) if len(self.controllers) == 1 else ("controller_x", "controller_y")
        with result_set(make_folder(folder)) as path:
            pictures = {picture_name(i): run.plot() for i, run in enumerate(self.runs)}
            return [
                write_document(path / "tuning.json", self.document()),
                *(
                    controller.save(path / f"{name}.json", report=self)
                    for name, controller in zip(names, self.controllers, strict=True)
                ),
                *save_figures(pictures, path),
            ]


def motion_of(run: Tracking | Contour) -> Reference | XYReference:
    """Return the reference or the path of a run."""
    return run.path if isinstance(run, Contour) else run.reference


def picture_name(i: int) -> str:
    """Name the picture of the loop along a reference."""
    return "tuned" if i == 0 else f"tuned_{i + 1}"


def _gains(law: FeedbackLaw, controller: Controller) -> dict[str, Any] | None:
    """Return the gains of a PID law as they are entered, the unit in the name."""
    if law.info.name != "pid":
        return None
    gains, (unit, scale) = gains_of(law._pid, controller.dt), shown_unit(controller.drive_unit)
    shown = {
        f"kp_{unit}_per_um": (gains.kp, 1e-6 * scale),
        "ti_ms": (gains.ti, 1e3),
        f"ki_{unit}_per_um_s": (gains.ki, 1e-6 * scale),
        "td_ms": (gains.td, 1e3),
        f"kd_{unit}_s_per_um": (gains.kd, 1e-6 * scale),
    }
    values = {name: factor * one for name, (one, factor) in shown.items() if one is not None}
    return {"law": gains.name, **values}


def _settings(controller: Controller) -> dict[str, Any]:
    """Return the settings of a controller for the JSON file."""
    law, learner = controller.feedback, controller.repetitive
    return {
        "dt": {"value": controller.dt, "unit": "s"},
        "limits": {"value": list(controller.limits), "unit": controller.drive_unit},
        "feedback": None if law is None else asdict(law),
        "gains": None if law is None else _gains(law, controller),
        "filters": [{"kind": type(one).__name__, **asdict(one)} for one in controller.filters],
        "repetitive": None if learner is None else asdict(learner),
    }
