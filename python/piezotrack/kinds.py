"""The kinds of stage that can be identified, saved and loaded."""

from __future__ import annotations

from typing import NamedTuple

from . import _core
from .bouc_wen import BoucWenStage
from .errors import ParameterError
from .first_order_dahl import FirstOrderDahlStage
from .models import DahlStage
from .oscillator import BoucWenOscillator

__all__ = ["Kind", "Stage", "kind_named", "kind_of"]

Stage = DahlStage | BoucWenStage | FirstOrderDahlStage | BoucWenOscillator


class Kind(NamedTuple):
    """What the rest of the package has to know of one kind of stage.

    Attributes
    ----------
    name : str
        As files and the command line have it.
    title : str
        As a sentence has it.
    stage : type
        Its class.
    parameters : list of (str, str, str)
        Name, symbol and unit of each parameter.
    forces : str
        Symbols of what scales along with the stiffness.
    """

    name: str
    title: str
    stage: type[Stage]
    parameters: list[tuple[str, str, str]]
    forces: str

    def built(self, values: list[float]) -> Stage:
        """Make a stage of values in the order of the parameters."""
        names = self.stage.parameter_names()
        return self.stage(**dict(zip(names, values, strict=True)))


KINDS = (
    Kind("dahl", "Dahl", DahlStage, _core.DAHL_PARAMETERS, "M, D, T, b1 and b0"),
    Kind("bouc-wen", "Bouc-Wen", BoucWenStage, _core.BOUC_WEN_PARAMETERS, "m and b"),
    Kind(
        "first-order-dahl",
        "first-order Dahl",
        FirstOrderDahlStage,
        FirstOrderDahlStage.PARAMETERS,
        "M, D, T, sigma and Fc",
    ),
    Kind(
        "bouc-wen-oscillator",
        "Bouc-Wen oscillator",
        BoucWenOscillator,
        BoucWenOscillator.PARAMETERS,
        "",
    ),
)


def kind_named(name: object) -> Kind:
    """Find the kind of a name."""
    for kind in KINDS:
        if kind.name == name:
            return kind
    expected = " or ".join(repr(kind.name) for kind in KINDS)
    raise ParameterError(f"model is {name!r}: expected {expected}")


def kind_of(stage: Stage) -> Kind:
    """Find the kind of a stage."""
    for kind in KINDS:
        if isinstance(stage, kind.stage):
            return kind
    raise ParameterError(f"model is {type(stage).__name__}: expected a stage")
