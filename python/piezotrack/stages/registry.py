"""The kinds of stage that can be identified, saved and loaded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from .. import _core
from ..errors import ParameterError
from .bouc_wen import BoucWenStage
from .bouc_wen_oscillator import BoucWenOscillator
from .dahl import DahlStage
from .first_order_dahl import FirstOrderDahlStage
from .prandtl_ishlinskii import PARAMETERS as PLAYS_PARAMETERS
from .prandtl_ishlinskii import PrandtlIshlinskiiStage

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["KINDS", "Kind", "Searched", "Stage", "kind_named", "kind_of"]

Stage = DahlStage | BoucWenStage | PrandtlIshlinskiiStage | FirstOrderDahlStage | BoucWenOscillator
# Names of those that a swarm searches, for types.
Searched = Literal["dahl", "bouc-wen", "first-order-dahl", "bouc-wen-oscillator"]


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
    searched : bool
        Whether a swarm searches its parameters; else they follow by least squares.
    drive_unit : str
        Unit of the drive.
    """

    name: str
    title: str
    stage: type[Stage]
    parameters: Sequence[tuple[str, str, str]]
    forces: str = ""
    searched: bool = True
    drive_unit: str = "V"

    def built(self, values: list[float]) -> Stage:
        """Make a stage of values in the order of the parameters."""
        names = [name for name, _, _ in self.parameters]
        named: dict[str, Any] = dict(zip(names, values, strict=True))
        return self.stage(**named)


KINDS = (
    Kind(
        "dahl",
        "Dahl",
        DahlStage,
        _core.DAHL_PARAMETERS,
        "M, D, T, b1 and b0",
    ),
    Kind(
        "bouc-wen",
        "Bouc-Wen",
        BoucWenStage,
        _core.BOUC_WEN_PARAMETERS,
        "m and b",
    ),
    Kind(
        "prandtl-ishlinskii",
        "Prandtl-Ishlinskii",
        PrandtlIshlinskiiStage,
        PLAYS_PARAMETERS,
        searched=False,
    ),
    Kind(
        "first-order-dahl",
        "first-order Dahl",
        FirstOrderDahlStage,
        _core.FIRST_ORDER_DAHL_PARAMETERS,
        "M, D, T, sigma and Fc",
    ),
    Kind(
        "bouc-wen-oscillator",
        "Bouc-Wen oscillator",
        BoucWenOscillator,
        _core.BOUC_WEN_OSCILLATOR_PARAMETERS,
        drive_unit="N",
    ),
)


def kind_named(name: object) -> Kind:
    """Find the kind of a name."""
    for kind in KINDS:
        if kind.name == name:
            return kind
    expected = " or ".join(repr(kind.name) for kind in KINDS)
    raise ParameterError(f"model is {name!r}: expected {expected}")


def kind_of(stage: Stage, argument: str = "model") -> Kind:
    """Find the kind of a stage, given as an argument of this name."""
    for kind in KINDS:
        if isinstance(stage, kind.stage):
            return kind
    raise ParameterError(
        f"{argument} is {type(stage).__name__}: expected a stage, as a pt.DahlStage"
    )
