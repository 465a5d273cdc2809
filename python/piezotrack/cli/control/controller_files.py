"""Controller files in the place of a model: what `tune` wrote, simulated as it is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import DataError, ParameterError
from .loop_options import PAPER, check_same_drive, known_model

if TYPE_CHECKING:
    from ...control.controller.controller import Controller
    from ...identification.fitted.identified_model import IdentifiedModel
    from ...response.response_data import FrequencyResponse
    from ...stages.virtual import VirtualStage
    from .loop_options import Simulation

__all__ = ["controller_in", "only_controller", "response_in", "stage_of_controller"]


def controller_in(file: Path) -> Controller | None:
    """Load a controller, or return None where the file is another."""
    from ...control.controller.controller import FORMAT
    from ...control.controller.load import load_controller
    from ...identification.fitted.model_file import read_content

    _, document = read_content(file)
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        return None
    return load_controller(file)


def response_in(file: Path) -> FrequencyResponse | None:
    """Load a frequency response, or return None where the file is another."""
    from ...identification.fitted.model_file import read_content
    from ...response.response_data import FORMAT
    from ...response.response_file import load_response

    _, document = read_content(file)
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        return None
    return load_response(file)


def only_controller(file: Path, remedy: str) -> Controller:
    """Load a controller; a model is refused with what to do."""
    from ...control.controller.load import load_controller
    from ...identification.fitted.model_file import read_content

    _, document = read_content(file)
    if isinstance(document, dict) and document.get("format") == "piezotrack-model":
        raise DataError(f"{file} is a model file: expected a controller file; {remedy}")
    return load_controller(file)


def stage_of_controller(
    controller: Controller, stage: str | None, simulation: Simulation
) -> tuple[VirtualStage, IdentifiedModel | None]:
    """Make the stage that a controller of a file drives."""
    from ...control.plant import plant_of_inverse
    from ...stages.virtual import VirtualStage

    parts: dict[str, Any] = simulation.parts
    if stage == PAPER:
        return VirtualStage.xu_li_2010(seed=simulation.seed), None
    if stage is not None:
        known = known_model(Path(stage), zero=False)
        check_same_drive(known, stage, controller.drive_unit)
        return VirtualStage.of(known, **parts), known
    if controller.feedforward is None:
        raise ParameterError(
            "--stage", "missing", "a model file, as the controller has no feedforward to simulate"
        )
    return plant_of_inverse(controller.feedforward, **parts), None
