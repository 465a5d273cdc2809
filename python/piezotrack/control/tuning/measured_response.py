"""Tuning on a measured frequency response: margins hold at every line, within its band."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import _core
from ...errors import ParameterError
from ...response.modal_fit import fit_modes
from .margins import Margins
from .tuned import MarginReport

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...response.response_data import FrequencyResponse
    from ...stages.virtual import VirtualStage
    from ..controller.controller import Controller
    from .tuned import Tuned

__all__ = ["controller_response", "tune_on_response", "worst_sensitivity"]

# Searches with tighter margins, and the largest sensitivity below which no gains are left.
ATTEMPTS, LEAST = 6, 1.05
# Factor on what the distance of the open loop from -1 is too short: few searches are needed.
BEYOND = 1.2


def tune_on_response(
    response: FrequencyResponse,
    tune: Callable[[VirtualStage, float, Margins], Tuned],
    dt: Any,
    margins: Margins | None,
) -> Tuned:
    """Tune on the modes fitted to a response, until the sensitivity holds at its lines.

    Parameters
    ----------
    response : FrequencyResponse
        The response.
    tune : callable
        Finds gains for a stage, a sampling interval and margins.
    dt : float or None
        Sampling interval [s]; that of the response, which is the default.
    margins : Margins or None
        What the loop keeps.

    Returns
    -------
    Tuned
        With the largest sensitivity at the lines among what is kept.

    Raises
    ------
    ParameterError
        `dt` is another, or no gains keep the margins within the band of the response.
    """
    if dt is not None and not (isinstance(dt, float) and abs(dt / response.dt - 1.0) < 1e-6):
        raise ParameterError(
            "dt",
            f"{dt!r}",
            f"{response.dt:.9g} s, as the response was measured; measure it at the rate of the "
            "loop, or tune on pt.fit_modes(response).stage",
        )
    wanted = Margins() if margins is None else margins
    stage, tightened = fit_modes(response).stage, wanted
    for _ in range(ATTEMPTS):
        tuned = tune(stage, response.dt, tightened)
        value, frequency = worst_sensitivity(response, tuned.controller)
        if value <= wanted.sensitivity:
            at = f"at {frequency:.4g} Hz of the response, with its band"
            kept = MarginReport("measured sensitivity", value, wanted.sensitivity, at)
            return replace(tuned, kept=(*tuned.kept, kept), margins=wanted)
        # By as much as the distance of the open loop from -1 is too short.
        short = 1.0 / wanted.sensitivity - 1.0 / value
        distance = 1.0 / tightened.sensitivity + BEYOND * short
        if distance >= 1.0 / LEAST:
            break
        tightened = replace(tightened, sensitivity=1.0 / distance)
    raise ParameterError(
        "margins",
        f"a sensitivity of {wanted.sensitivity:.3g}",
        f"{value:.3g} at least within the band of the response at {frequency:.4g} Hz: a larger "
        "amplitude or more periods and realisations narrow the band",
        verb="have",
    )


def worst_sensitivity(response: FrequencyResponse, controller: Controller) -> tuple[float, float]:
    """Return the largest sensitivity within the band of a response, and its frequency [Hz].

    The open loop at a line is within a circle: its distance from -1 is at least that of the middle
    less the radius.
    """
    gain = controller_response(controller, response.frequency)
    distance = np.abs(1.0 + gain * response.value) - np.abs(gain) * response.band()
    worst = int(np.argmin(distance))
    value = 1.0 / distance[worst] if distance[worst] > 0.0 else np.inf
    return float(value), float(response.frequency[worst])


def controller_response(
    controller: Controller, frequency: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Return the response of filters and feedback [V/m] at frequencies [Hz], sampled."""
    feedback = replace(controller, feedforward=None, repetitive=None)
    unit = _core.LoopPlant.from_matrices([], [], [], 1.0, 0.0)
    loop = _core.loop_response(feedback._core, unit, frequency.tolist())[0]
    # A plant answers a held voltage one sample later.
    later = np.exp(2j * np.pi * frequency * controller.dt)
    return np.asarray(np.asarray(loop) @ np.array([1.0, 1.0j]) * later)
