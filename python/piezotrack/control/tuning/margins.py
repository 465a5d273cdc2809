"""Margins of a tuned loop, and the set of plants for which it keeps them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ... import _core
from ..._support.arguments import finite, not_negative
from ...errors import ParameterError
from ..plant import linearised_plants, plant_of

if TYPE_CHECKING:
    from ...identification.fitted.identified_model import IdentifiedModel
    from ..plant import Plant

__all__ = ["Margins", "NamedPlant", "Spread", "plants_of"]

CASES = ("low gain", "middle gain", "high gain")


@dataclass(frozen=True, kw_only=True)
class Margins:
    """Distances from instability that a tuned loop keeps, for every plant of a set.

    Parameters
    ----------
    gain : float, optional
        Least gain margin, a factor above 1.
    phase : float, optional
        Least phase margin [rad], 0 to below pi.
    sensitivity : float, optional
        Largest sensitivity Ms, above 1. Ms = 2 alone implies a gain margin of 2 and a phase margin
        of 0.5 rad (Astrom and Hagglund, Advanced PID Control, 2006, section 4.6).
    learning : float, optional
        Largest gain from what the repetitive part learns in one period to what it learns in the
        next, at most 1.

    Raises
    ------
    ParameterError
        A number is out of its range.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.Margins(sensitivity=1.6).gain
    2.0
    """

    gain: float = 2.0
    phase: float = 0.5
    sensitivity: float = 2.0
    learning: float = 1.0

    def __post_init__(self) -> None:
        names = ("gain", "phase", "sensitivity", "learning")
        _core.check_margins(*(_core.as_number(name, getattr(self, name)) for name in names))


@dataclass(frozen=True, kw_only=True)
class Spread:
    """Deviations of the stage from its model.

    Each end of delay, mode and gain is added to the set of plants.

    Parameters
    ----------
    delay : (float, float), optional
        Least and largest delay in addition to that of the loop [s].
    mode : float, optional
        Share by which all dynamics may be slower or faster, as 0.1 for a mode between 10 % below
        and 10 % above its frequency.
    gain : float, optional
        Share by which the static gain may be lower or higher, beyond the least and the largest gain
        of the hysteresis.
    offset : float, optional
        Share of the stroke by which the feedforward is off at the start of each reference; until
        its end it drifts to as much on the other side. The stroke is that of the motion, with the
        way to its first point. Only the error that is made small has it, no margin does.

    Raises
    ------
    ParameterError
        A number is out of its range.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.Spread(delay=(0.0, 1e-3), mode=0.1).gain
    0.0
    """

    delay: tuple[float, float] = (0.0, 0.0)
    mode: float = 0.0
    gain: float = 0.0
    offset: float = 0.02

    def __post_init__(self) -> None:
        if not isinstance(self.delay, Sequence) or len(self.delay) != 2:
            raise ParameterError("delay", f"{self.delay!r}", "(least, largest) in s")
        low, high = (not_negative("delay", one, "s") for one in self.delay)
        if low > high:
            raise ParameterError("delay", f"({low:g}, {high:g}) s", "the lower one first")
        for name in ("mode", "gain", "offset"):
            if not 0.0 <= finite(name, getattr(self, name), "") < 0.95:
                raise ParameterError(name, getattr(self, name), "a share, 0 to below 0.95")


class NamedPlant(NamedTuple):
    """A plant of the set, and which it is in words."""

    name: str
    plant: _core.LoopPlant


def plants_of(
    stages: Sequence[Plant | IdentifiedModel],
    limits: tuple[float, float],
    delay: float,
    spread: Spread,
) -> list[NamedPlant]:
    """Linearise stages at their lowest, middle and highest gain, with every end of the spread."""
    plants = []
    for i, stage in enumerate(stages):
        which = f"model {i + 1}, " if len(stages) > 1 else ""
        for late in sorted(set(spread.delay)):
            linear = linearised_plants(plant_of(stage), limits, delay + late)
            for case, plant in zip(CASES, linear, strict=True):
                text = f"{which}{case}"
                if late > 0.0:
                    text += f", {1e3 * late:.3g} ms more delay"
                plants += _spread(text, plant, spread)
    return plants


def _spread(text: str, plant: _core.LoopPlant, spread: Spread) -> list[NamedPlant]:
    """Vary dynamics and gain of a plant."""
    a, b, c, d, delay = plant.matrices()
    plants = []
    for rate, tempo in _ends(spread.mode, "dynamics", ("slower", "faster")):
        for gain, size in _ends(spread.gain, "gain", ("lower", "higher")):
            scaled = ((rate, a), (rate, b), (gain, c))
            rows, inputs, outputs = ((factor * np.array(part)).tolist() for factor, part in scaled)
            varied = _core.LoopPlant.from_matrices(rows, inputs, outputs, gain * d, delay)
            plants.append(NamedPlant(text + tempo + size, varied))
    return plants


def _ends(share: float, name: str, words: tuple[str, str]) -> list[tuple[float, str]]:
    if share == 0.0:
        return [(1.0, "")]
    percent = f"{100.0 * share:.3g} %"
    return [
        (1.0 - share, f", {name} {percent} {words[0]}"),
        (1.0, ""),
        (1.0 + share, f", {name} {percent} {words[1]}"),
    ]
