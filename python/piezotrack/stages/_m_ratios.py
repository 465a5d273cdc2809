"""What of each kind of stage does not depend on the scale of the forces."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from .. import _core

if TYPE_CHECKING:
    from .bouc_wen import BoucWenStage
    from .first_order_dahl import FirstOrderDahlStage
    from .dahl import DahlStage
    from .bouc_wen_oscillator import BoucWenOscillator

__all__ = ["Ratio", "bouc_wen", "bouc_wen_oscillator", "dahl", "first_order_dahl"]

# Parameter, symbol, value and unit.
Ratio = tuple[str, str, float, str]


def _mechanical(stage: Any, damping: str, mass: str) -> list[Ratio]:
    """Viscous time and mass over stiffness, with the natural frequency that they mean."""
    frequency = math.sqrt(stage.stiffness / stage.mass) / (2 * math.pi)
    hertz = f"s^2, a natural frequency of {frequency:.4g} Hz"
    return [
        ("damping", damping, 1e3 * stage.damping / stage.stiffness, "ms"),
        ("mass", mass, stage.mass / stage.stiffness, hertz),
    ]


def dahl(stage: DahlStage) -> list[Ratio]:
    """All but up, which the data do not tell from b1 and b0."""
    gain = 1e6 * stage.piezo_coefficient / stage.stiffness
    return [
        ("piezo_coefficient", "T/K", gain, "um/V"),
        *_mechanical(stage, "D/K", "M/K"),
        ("b1", "b1 up/K", stage.b1 * stage.up / stage.stiffness, "1/m"),
        ("a1", "a1", stage.a1, "1/m"),
        ("a2", "a2", stage.a2, "1/m^2"),
        ("b0", "b0 up/K", stage.b0 * stage.up / stage.stiffness, ""),
    ]


def bouc_wen(stage: BoucWenStage) -> list[Ratio]:
    """All but the exponent, which is held."""
    return [
        ("piezo_coefficient", "d", 1e6 * stage.piezo_coefficient, "um/V"),
        *_mechanical(stage, "b/k", "m/k"),
        ("alpha", "alpha", stage.alpha, ""),
        ("beta", "beta", stage.beta, "1/V"),
        ("gamma", "gamma", stage.gamma, "1/V"),
    ]


def first_order_dahl(stage: FirstOrderDahlStage) -> list[Ratio]:
    """All but the exponent, which is held."""
    gain = 1e6 * stage.piezo_coefficient / stage.stiffness
    reach = 1e6 * stage.coulomb_force / stage.stiffness
    return [
        ("piezo_coefficient", "T/K", gain, "um/V"),
        *_mechanical(stage, "D/K", "M/K"),
        ("rest_stiffness", "sigma/K", stage.rest_stiffness / stage.stiffness, ""),
        ("coulomb_force", "Fc/K", reach, "um"),
    ]


def bouc_wen_oscillator(stage: BoucWenOscillator) -> list[Ratio]:
    """All of it: the drive is a force."""
    values = zip(_core.BOUC_WEN_OSCILLATOR_PARAMETERS, stage.theta, strict=True)
    return [(name, symbol, value, unit) for (name, symbol, unit), value in values]
