"""Models that a learning control must converge on: gains of the hysteresis, delays, modes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ..._support.arguments import not_negative, one_or_more_numbers, positive
from ...errors import NumericalError, ParameterError
from ..controller.controller import Controller
from ..laws.state_space import StateSpace
from ..plant import linearised_plants, plant_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...identification.fitted.identified_model import IdentifiedModel
    from ..plant import Plant

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

__all__ = ["LearningPlant", "learning_plants"]

GAINS = ("low", "middle", "high")
# Longest impulse response [samples], and the part of its peak that may be left at its end.
LONGEST = 2**20
LEFT = 1e-9


@dataclass(frozen=True, eq=False)
class LearningPlant:
    """Plant of the learning: from the learnt voltage to the displacement, the loop closed.

    Attributes
    ----------
    name : str
        Which of the models, in words.
    plant : LoopPlant
        The stage for small motions.
    controller : Controller
        With the feedback, if there is any.
    """

    name: str
    plant: _core.LoopPlant
    controller: Controller

    def response(self, frequency: Array) -> Complex:
        """Return the frequency response [m/V] at frequencies [Hz] up to half the sampling rate."""
        dt = self.controller.dt
        # Not at 0, where an integrator is infinite, nor beyond half the sampling rate.
        points = np.clip(frequency, 1e-12 / dt, 0.5 / dt).tolist()
        alone = Controller(dt=dt, limits=(-1.0, 1.0), feedback=StateSpace([[0.0]], [0.0], [0.0], 1))
        stage = _complex(_core.loop_response(alone._core, self.plant, points)[0])
        if self.controller.feedback is None:
            return stage
        found = _core.loop_response(self.controller._core, self.plant, points)
        return stage * _complex(found[1])

    def impulse(self, count: int) -> Array:
        """Return the impulse response [m/V] at the first `count` samples."""
        dt, last = self.controller.dt, None
        size = 1 << max(8, (2 * count - 1).bit_length())
        while size <= LONGEST:
            whole = np.fft.irfft(self.response(np.arange(size // 2 + 1) / (size * dt)), size)
            # What is left at the end of a period is folded into its beginning.
            if last is not None:
                folded = np.abs(whole[:count] - last[:count]).max()
                if folded <= LEFT * np.abs(whole).max():
                    return whole[:count]
            last, size = whole, 2 * size
        raise NumericalError(
            f"the impulse response of {self.name} lasts more than {LONGEST} samples: expected a "
            "stable loop that settles sooner"
        )


def _complex(pairs: Sequence[tuple[float, float]]) -> Complex:
    parts = np.asarray(pairs, dtype=np.float64)
    made: Complex = parts[:, 0] + 1j * parts[:, 1]
    return made


def learning_plants(
    models: Sequence[Plant | IdentifiedModel],
    controller: Controller,
    *,
    delay: float,
    more_delays: float | Sequence[float],
    mode_scales: float | Sequence[float],
) -> tuple[LearningPlant, list[LearningPlant]]:
    """Linearise models at three gains, with all delays and modes.

    Parameters
    ----------
    models : sequence of Stage, VirtualStage or IdentifiedModel
        The first is the one that the learning filter is made of.
    controller : Controller
        Its limits, sampling interval and feedback.
    delay : float
        Delay of the loop [s], in all of them.
    more_delays : sequence of float
        Delays in addition [s], of each.
    mode_scales : sequence of float
        Factors on the frequencies of the linear dynamics.

    Returns
    -------
    LearningPlant
        The first model at its middle gain, with `delay` only.
    list of LearningPlant
        All of them.
    """
    delay = not_negative("delay", delay, "s")
    later = [not_negative("more_delays", one, "s") for one in _some("more_delays", more_delays)]
    scales = [positive("mode_scales", one, "1") for one in _some("mode_scales", mode_scales)]
    without = replace(controller, repetitive=None)
    plants, nominal = [], None
    for i, model in enumerate(models):
        stage = plant_of(model)
        title = stage.stage.info.title + (f" (models[{i - 1}])" if i else "")
        three = linearised_plants(stage, controller.limits, delay)
        nominal = nominal or LearningPlant(f"{title}, middle gain", three[1], without)
        for gain, plant in zip(GAINS, three, strict=True):
            for scale in scales:
                for more in later:
                    name = f"{title}, {gain} gain"
                    name += "" if scale == 1.0 else f", modes at {scale:g} times"
                    name += "" if more == 0.0 else f", {1e3 * more:.3g} ms more delay"
                    plants.append(LearningPlant(name, _varied(plant, scale, more), without))
    if nominal is None:
        raise ParameterError("models", "empty", "a stage or an identified model")
    return nominal, plants


def _some(name: str, given: float | Sequence[float]) -> tuple[float, ...]:
    listed = one_or_more_numbers(name, given)
    if not listed:
        raise ParameterError(name, "empty", "a number or several")
    return listed


def _varied(plant: _core.LoopPlant, scale: float, more: float) -> _core.LoopPlant:
    """Scale the frequencies of a plant, and delay it; its static gain stays."""
    a, b, c, d, late = plant.matrices()
    if scale == 1.0 and more == 0.0:
        return plant
    faster, driven = ([scale * entry for entry in entries] for entries in (a, b))
    return _core.LoopPlant.from_matrices(faster, driven, c, d, late + more)
