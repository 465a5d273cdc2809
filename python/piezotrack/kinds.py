"""The kinds of stage that can be identified, saved and loaded."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _core
from .bouc_wen import BoucWenStage
from .errors import ParameterError
from .first_order_dahl import FirstOrderDahlStage
from .models import DahlStage
from .oscillator import BoucWenOscillator

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["Kind", "Stage", "kind_named", "kind_of"]

Stage = DahlStage | BoucWenStage | FirstOrderDahlStage | BoucWenOscillator


Ratio = tuple[str, str, float, str]


def _mechanical(stage: Any, damping: str, mass: str) -> list[Ratio]:
    """Viscous time and mass over stiffness, with the natural frequency that they mean."""
    frequency = math.sqrt(stage.stiffness / stage.mass) / (2 * math.pi)
    hertz = f"s^2, a natural frequency of {frequency:.4g} Hz"
    return [
        ("damping", damping, 1e3 * stage.damping / stage.stiffness, "ms"),
        ("mass", mass, stage.mass / stage.stiffness, hertz),
    ]


def _dahl(stage: DahlStage) -> list[Ratio]:
    gain = 1e6 * stage.piezo_coefficient / stage.stiffness
    return [
        ("piezo_coefficient", "T/K", gain, "um/V"),
        *_mechanical(stage, "D/K", "M/K"),
        ("b1", "b1 up/K", stage.b1 * stage.up / stage.stiffness, "1/m"),
        ("a1", "a1", stage.a1, "1/m"),
        ("a2", "a2", stage.a2, "1/m^2"),
        ("b0", "b0 up/K", stage.b0 * stage.up / stage.stiffness, ""),
    ]


def _bouc_wen(stage: BoucWenStage) -> list[Ratio]:
    return [
        ("piezo_coefficient", "d", 1e6 * stage.piezo_coefficient, "um/V"),
        *_mechanical(stage, "b/k", "m/k"),
        ("alpha", "alpha", stage.alpha, ""),
        ("beta", "beta", stage.beta, "1/V"),
        ("gamma", "gamma", stage.gamma, "1/V"),
    ]


def _first_order_dahl(stage: FirstOrderDahlStage) -> list[Ratio]:
    gain = 1e6 * stage.piezo_coefficient / stage.stiffness
    reach = 1e6 * stage.coulomb_force / stage.stiffness
    return [
        ("piezo_coefficient", "T/K", gain, "um/V"),
        *_mechanical(stage, "D/K", "M/K"),
        ("rest_stiffness", "sigma/K", stage.rest_stiffness / stage.stiffness, ""),
        ("coulomb_force", "Fc/K", reach, "um"),
    ]


def _oscillator(stage: BoucWenOscillator) -> list[Ratio]:
    """All of it: the drive is a force."""
    values = zip(stage.PARAMETERS, stage.theta, strict=True)
    return [(name, symbol, value, unit) for (name, symbol, unit), value in values]


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
    ratios : callable
        Parameter, symbol, value and unit of all that does not depend on the scale of the forces.
    """

    name: str
    title: str
    stage: type[Stage]
    parameters: list[tuple[str, str, str]]
    forces: str
    ratios: Callable[[Any], list[Ratio]]

    def built(self, values: list[float]) -> Stage:
        """Make a stage of values in the order of the parameters."""
        names = self.stage.parameter_names()
        return self.stage(**dict(zip(names, values, strict=True)))


KINDS = (
    Kind("dahl", "Dahl", DahlStage, _core.DAHL_PARAMETERS, "M, D, T, b1 and b0", _dahl),
    Kind("bouc-wen", "Bouc-Wen", BoucWenStage, _core.BOUC_WEN_PARAMETERS, "m and b", _bouc_wen),
    Kind(
        "first-order-dahl",
        "first-order Dahl",
        FirstOrderDahlStage,
        FirstOrderDahlStage.PARAMETERS,
        "M, D, T, sigma and Fc",
        _first_order_dahl,
    ),
    Kind(
        "bouc-wen-oscillator",
        "Bouc-Wen oscillator",
        BoucWenOscillator,
        BoucWenOscillator.PARAMETERS,
        "",
        _oscillator,
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
