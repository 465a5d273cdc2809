"""The XY stages that ``contour`` simulates: of one's own models, or that of the paper."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import ParameterError
from .controller_files import controller_in, stage_of_controller
from .loop_options import PAPER, drive_notes, driven_by_voltage, known_model, stage_model

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...control.controller.controller import Controller
    from ...control.loop.contouring import Contour
    from ...identification.fitted.identified_model import IdentifiedModel
    from ...references.xy_reference import XYReference
    from ...stages.inverse import Inverse
    from ...stages.virtual import VirtualStage
    from ...stages.xy import XYStage
    from .loop_options import FeedbackOptions, Simulation

__all__ = ["ControllerStage", "OwnStage", "PaperStage", "controllers_in"]


def controllers_in(files: Sequence[str]) -> tuple[Controller, Controller] | None:
    """Load the controllers of x and y, or return None where the files are models."""
    found = [controller_in(Path(file)) for file in files]
    known = [one for one in found if one is not None]
    if known and len(known) < len(found):
        raise ParameterError("MODEL_Y", files[1], "two models, or two controllers")
    return (known[0], known[-1]) if known else None


class _Axes(ABC):
    """An XY stage of two stages, between the limits of its controllers."""

    name = ""
    words = "feedforward by the inverse of each"

    @abstractmethod
    def _plants(self, simulation: Simulation) -> list[VirtualStage]:
        """Make the stages of x and y."""

    @abstractmethod
    def _limits(self) -> list[tuple[float, float]]:
        """Return the limits of both controllers."""

    def stage(self, simulation: Simulation) -> XYStage:
        """Make the stage, with noise of its sensors and bandwidth of its amplifiers."""
        from ...stages.xy import XYStage

        x, y = self._plants(simulation)
        return XYStage(x=x, y=y)

    def place(self, stage: XYStage) -> dict[str, Any]:
        """Find centre and origin of a path: the middle of the workspace, where a run begins."""
        from ...control.loop.contouring import workspace

        found = workspace(stage, self._limits())
        return {"centre": found.centre, "origin": found.rest}


def _seeds(simulation: Simulation) -> list[Simulation]:
    """Give each axis a seed: with one both would have the same noise."""
    from dataclasses import replace

    return [replace(simulation, seed=simulation.seed + axis * (1 << 32)) for axis in range(2)]


class OwnStage(_Axes):
    """The stage of one's own models, of x and y or one for both, or of others in their place."""

    def __init__(
        self, models: list[str], loop: FeedbackOptions, stages: list[str] | None = None
    ) -> None:
        files = [models[0], models[-1]]
        self._models: list[IdentifiedModel] = [
            known_model(Path(file), zero=False) for file in files
        ]
        self._loop = loop
        others: list[str | None] = [stages[0], stages[-1]] if stages else [None, None]
        pairs = zip(others, self._models, strict=True)
        self._stages = [stage_model(other, model) for other, model in pairs]
        self.name = " and ".join(dict.fromkeys(stages or files))

    def _plants(self, simulation: Simulation) -> list[VirtualStage]:
        seeds = _seeds(simulation)
        return [one.stage(None, model) for one, model in zip(seeds, self._stages, strict=True)]

    def _limits(self) -> list[tuple[float, float]]:
        return [self._loop.volts(model) for model in self._models]

    def controllers(self, path: XYReference) -> tuple[Controller, Controller]:
        """Make the controllers of x and y."""
        from ...control.controller.controller import Controller

        x, y = (
            Controller(
                dt=self._loop.interval(self._models[0], path.x),
                limits=limits,
                feedforward=model.inverse() if self._loop.feedforward else None,
                feedback=self._loop.pid(model, own=True),
                drive_unit=model.drive_unit,
            )
            for model, limits in zip(self._models, self._limits(), strict=True)
        )
        return x, y

    def notes(self, run: Contour) -> list[str]:
        """Remarks on each axis beyond the range or the rate of its record."""
        axes = zip("xy", self._models, (run.x, run.y), strict=True)
        return [f"{axis}: {note}" for axis, model, of in axes for note in drive_notes(model, of)]


class ControllerStage(_Axes):
    """The stage that controllers of files drive: of their feedforward, or of other models."""

    words = "controllers of files"

    def __init__(
        self,
        loops: tuple[Controller, Controller],
        files: list[str],
        stages: list[str] | None = None,
    ) -> None:
        self._loops = loops
        self._others: list[str | None] = [stages[0], stages[-1]] if stages else [None, None]
        self.name = " and ".join(dict.fromkeys(stages or files))

    def _plants(self, simulation: Simulation) -> list[VirtualStage]:
        rows = zip(self._loops, self._others, _seeds(simulation), strict=True)
        return [stage_of_controller(*row)[0] for row in rows]

    def _limits(self) -> list[tuple[float, float]]:
        return [loop.limits for loop in self._loops]

    def controllers(self, path: XYReference) -> tuple[Controller, Controller]:
        """Return the controllers of x and y."""
        del path
        return self._loops

    def notes(self, run: Contour) -> list[str]:
        """Return nothing: a controller file has no record."""
        del run
        return []


class PaperStage:
    """The virtual stage of the paper, with one model for the feedforward of both axes."""

    name = "the virtual XY stage of Xu and Li 2010"

    def __init__(self, models: list[str], loop: FeedbackOptions, seed: int) -> None:
        if len(models) > 1:
            raise ParameterError(
                "MODEL_Y", models[1], f"one model file with --stage {PAPER}, for both axes"
            )
        self._file = Path(models[0]) if models else None
        self._loop, self._seed = loop, seed
        self.words = ""

    def stage(self, simulation: Simulation) -> XYStage:
        """Make the stage; its sensors and amplifiers are its own."""
        from ...stages.xy import XYStage

        return XYStage.xu_li_2010(seed=simulation.seed)

    def place(self, stage: XYStage) -> dict[str, Any]:
        """Leave centre and origin to the defaults of the paths."""
        del stage
        return {}

    def notes(self, run: Contour) -> list[str]:
        """Return nothing: the stage of the paper has no record."""
        del run
        return []

    def controllers(self, path: XYReference) -> tuple[Controller, Controller]:
        """Make the controllers of x and y."""
        from ...control.controller.controller import Controller

        controller = Controller(
            dt=self._loop.interval(None, path.x, own=False),
            limits=self._loop.volts(None, own=False),
            feedforward=self._inverse() if self._loop.feedforward else None,
            feedback=self._loop.pid(None, own=False),
        )
        return controller, controller

    def _inverse(self) -> Inverse:
        """Invert the model, or one identified as in the paper."""
        from ...identification.fitted.model_file import load
        from ...xu_li_2010.demo import demo_log, identify_demo

        if self._file is not None:
            self.words = f"feedforward by {self._file.name} on both axes"
            return driven_by_voltage(load(self._file), self._file).inverse()
        fit = identify_demo(demo_log(self._seed), seed=self._seed, progress=False)
        self.words = f"feedforward on both axes by a model of x, fitted to {fit.cost_um:.3g} um rms"
        return fit.inverse()
