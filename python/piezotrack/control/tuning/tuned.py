"""Result of a tuning: the controller, its margins, and the active constraints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from ..._support.units import shown_unit
from ..loop.contouring import Contour

if TYPE_CHECKING:
    from ..controller.controller import Controller
    from ..loop.tracking import Tracking
    from ..parts.filters import Filter
    from ..parts.repetitive import Repetitive
    from .margins import Margins

__all__ = ["MarginReport", "Tuned", "TunedPair", "TuningReport", "parts_text"]

UNITS = {"gain margin": "", "phase margin": " rad", "sensitivity": "", "learning": ""}


class MarginReport(NamedTuple):
    """A margin over the set of plants.

    Attributes
    ----------
    name : str
        Which margin.
    value : float
        Of the worst plant, exact.
    bound : float
        The bound.
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
        unit = UNITS[self.name]
        return f"{self.name} {self.value:.3g}{unit} ({side} {self.bound:.3g}{unit}), {self.plant}"


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class TuningReport:
    """Report of a tuning: runs, margins, active constraints, effort of the search.

    Attributes
    ----------
    minimised : str
        The figure that was made small.
    unit : str
        Its unit: ``"m"``, of the effort ``"V"``.
    value : float
        Its value; without a reference the integral of the error after a step disturbance of
        1 V at the input of the stage [m s/V].
    runs : tuple of Tracking or of Contour
        Full simulations of the tuned loop, one for each reference.
    kept : tuple of MarginReport
        The margins over the set of plants.
    margins : Margins
        The bounds.
    plants : tuple of str
        The plants of the set.
    active_constraints : tuple of str
        What forbids a smaller value: margins and bounds of the goal that are used up, settings at
        the ends of their ranges. Empty where the value has its minimum inside.
    dt : float
        Sampling interval [s].
    candidates, loops : int
        Controllers evaluated, and closed loops simulated.
    history : tuple of float
        Best figure after each iteration; infinite as long as no candidate kept the margins.
    """

    minimised: str
    value: float
    runs: tuple[Any, ...]
    kept: tuple[MarginReport, ...]
    margins: Margins
    plants: tuple[str, ...]
    active_constraints: tuple[str, ...]
    dt: float
    candidates: int
    loops: int
    history: tuple[float, ...]
    unit: str = "m"

    def __str__(self) -> str:
        lines = [
            f"{self.minimised}, at {1.0 / self.dt:.6g} Hz: {self.candidates} controllers "
            f"evaluated, {self.loops} loops simulated"
        ]
        if self.runs:
            scale, unit = (1e6, "um") if self.unit == "m" else (1.0, self.unit)
            lines.append(
                f"{scale * self.value:.4g} {unit} after settling, and after learning where "
                "something learns"
            )
        for run in self.runs:
            lines += _run_lines(run)
        lines.append(f"over {len(self.plants)} plants:")
        lines += [f"  {one}" for one in self.kept]
        active = "; ".join(self.active_constraints)
        active = active or "none: the minimum lies inside the bounds"
        lines.append(f"active constraints: {active}")
        return "\n".join(lines)

    def design(self) -> dict[str, Any]:
        """Margins for the file of the controller.

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
            "kept": [one._asdict() for one in self.kept],
            "binding": list(self.active_constraints),
        }

    def __repr__(self) -> str:
        return f"<TuningReport: {self.minimised}, {len(self.plants)} plants>"


class Tuned(NamedTuple):
    """A tuned controller and the report of its search.

    Attributes
    ----------
    controller : Controller
        To be used as it is.
    report : TuningReport
        Its margins and active constraints.
    """

    controller: Controller
    report: TuningReport

    def __str__(self) -> str:
        return f"{parts_text(self.controller)}\n{self.report}"

    def design(self) -> dict[str, Any]:
        """Margins for the file of the controller, those of `report`.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return self.report.design()


class TunedPair(NamedTuple):
    """The tuned controllers of an XY stage and the report of their search.

    Attributes
    ----------
    controllers : (Controller, Controller)
        Of x and y, for `contour`.
    report : TuningReport
        Their margins and active constraints.
    """

    controllers: tuple[Controller, Controller]
    report: TuningReport

    def __str__(self) -> str:
        x, y = (parts_text(one).replace("\n", "; ") for one in self.controllers)
        return f"x: {x}\ny: {y}\n{self.report}"


def _run_lines(run: Tracking | Contour) -> list[str]:
    if isinstance(run, Contour):
        return [f"{run.path!r}: contour error {run.metrics}"]
    return [f"{run.reference!r}: {run.metrics}"]


def parts_text(controller: Controller) -> str:
    """Write the gains of a controller with their units."""
    unit, scale = shown_unit(controller.drive_unit)
    text = []
    law = controller.feedback
    if law is not None and law.info.name == "pid":
        pid = law._pid
        text.append(
            f"PID: kp {1e-6 * scale * pid.kp:.4g} {unit}/um, ti {1e3 * pid.ti:.4g} ms, "
            f"td {1e3 * pid.td:.4g} ms"
        )
    elif law is not None:
        text.append(repr(law))
    text += [_filter_text(one) for one in controller.filters]
    if controller.repetitive is not None:
        text.append(_repetitive_text(controller.repetitive, unit, scale))
    return "\n".join(text) or "no feedback"


def _filter_text(one: Filter) -> str:
    values = one._values
    if one.info.name == "low-pass":
        return f"low-pass: {values['cutoff']:.4g} Hz"
    frequency, width, depth = (values[name] for name in ("frequency", "width", "depth"))
    return f"notch: {frequency:.4g} Hz, width {width:.3g}, depth {depth:.3g}"


def _repetitive_text(part: Repetitive, unit: str, scale: float) -> str:
    return (
        f"repetitive: kq {1e-6 * scale * part.kq:.3g} {unit}/um, {part.smoothing}, "
        f"lead {part.lead} samples, forgetting factor {part.forgetting_factor:.4g}"
    )
