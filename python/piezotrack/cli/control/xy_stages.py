"""The XY stages that ``contour`` simulates: of one's own models, or that of the paper."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...errors import ParameterError
from .loop_options import PAPER, drive_notes, driven_by_voltage, stage_model

if TYPE_CHECKING:
    from pathlib import Path

    from ...control.controller.controller import Controller
    from ...control.loop.contouring import Contour
    from ...identification.fitted.identified_model import IdentifiedModel
    from ...references.xy_reference import XYReference
    from ...stages.inverse import Inverse
    from ...stages.xy import XYStage
    from .loop_options import Loop

__all__ = ["OwnStage", "PaperStage"]


class OwnStage:
    """The stage of one's own models, of x and y or one for both, or of others in their place."""

    def __init__(
        self,
        models: list[Path] | None,
        loops: tuple[Loop, Loop],
        stages: list[str] | None = None,
    ) -> None:
        from ...identification.fitted.model_file import load

        files = models or []
        self._files = [files[0], files[-1]]
        self._models: list[IdentifiedModel] = [load(file) for file in self._files]
        self._loops = loops
        others: list[str | None] = [stages[0], stages[-1]] if stages else [None, None]
        pairs = zip(others, self._models, strict=True)
        self._plants = [stage_model(other, model) for other, model in pairs]
        names = dict.fromkeys(stages or map(str, self._files))
        self.name = " and ".join(names)
        self.words = "feedforward by the inverse of each"

    def stage(self, noise: float, bandwidth: float, seed: int) -> XYStage:
        """Make the stage, with noise of its sensors [m] and bandwidth of its amplifiers [Hz]."""
        from ...stages.virtual import VirtualStage
        from ...stages.xy import XYStage

        # With one seed both would have the same noise.
        x, y = (
            VirtualStage.of(model, noise=noise, bandwidth=bandwidth, seed=seed + axis * (1 << 32))
            for axis, model in enumerate(self._plants)
        )
        return XYStage(x=x, y=y)

    def _limits(self) -> list[tuple[float, float]]:
        return [loop.volts(model) for loop, model in zip(self._loops, self._models, strict=True)]

    def place(self, stage: XYStage) -> dict[str, Any]:
        """Find centre and origin of a path: the middle of the workspace, where a run begins."""
        from ...control.loop.contouring import workspace

        found = workspace(stage, self._limits())
        return {"centre": found.centre, "origin": found.rest}

    def controllers(
        self, path: XYReference | None, feedforward: bool
    ) -> tuple[Controller, Controller]:
        """Make the controllers of x and y."""
        from ...control.controller.controller import Controller

        assert path is not None
        x, y = (
            Controller(
                dt=loop.dt(self._models[0], path.x),
                limits=limits,
                feedforward=model.inverse() if feedforward else None,
                feedback=loop.pid(model),
                drive_unit=model.drive_unit,
            )
            for loop, model, limits in zip(self._loops, self._models, self._limits(), strict=True)
        )
        return x, y

    def notes(self, run: Contour) -> list[str]:
        """Remarks on each axis beyond the range or the rate of its record."""
        axes = zip("xy", self._models, (run.x, run.y), strict=True)
        return [f"{axis}: {note}" for axis, model, of in axes for note in drive_notes(model, of)]


class PaperStage:
    """The virtual stage of the paper, with one model for the feedforward of both axes."""

    name = "the virtual XY stage of Xu and Li 2010"

    def __init__(self, models: list[Path] | None, loop: Loop, seed: int) -> None:
        if models and len(models) > 1:
            raise ParameterError(
                "MODEL_Y", models[1], f"one model file with --stage {PAPER}, for both axes"
            )
        self._file = models[0] if models else None
        self._loop, self._seed = loop, seed
        self.words = ""

    def stage(self, noise: float, bandwidth: float, seed: int) -> XYStage:
        """Make the stage, with noise of its sensors [m] and bandwidth of its amplifiers [Hz]."""
        from ...stages.xy import XYStage

        # Its sensors and amplifiers are its own.
        del noise, bandwidth
        return XYStage.xu_li_2010(seed=seed)

    def place(self, stage: XYStage) -> dict[str, Any]:
        """Leave centre and origin to the defaults of the paths."""
        del stage
        return {}

    def notes(self, run: Contour) -> list[str]:
        """Say nothing of the stage of the paper."""
        del run
        return []

    def controllers(
        self, path: XYReference | None, feedforward: bool
    ) -> tuple[Controller, Controller]:
        """Make the controllers of x and y."""
        from ...control.controller.controller import Controller

        inverse = self._inverse() if feedforward else None
        interval = path.x if path is not None else None
        controller = Controller(
            dt=self._loop.dt(None, interval),
            limits=self._loop.volts(None),
            feedforward=inverse,
            feedback=self._loop.pid(None),
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
