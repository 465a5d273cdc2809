"""Settings that a search for gains begins with besides random ones."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from .structures import nominal_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ... import _core

__all__ = ["cancelled", "damped", "place_of", "simc"]

# Places of settings of which a start says nothing: as if the part were not there.
ABSENT = {
    "kd": 0.0,
    "cutoff": 1.0,
    "notch_depth": 1.0,
    "observer": 0.0,
    "switching": 1.0,
    "kq": 0.0,
}
# Gains of the rule, and smaller ones where a resonance forbids these.
SHARES = (1.0, 0.5, 0.25, 0.125)
# Damping ratio of a mode with its filter of second order.
WANTED = 0.4
# Width of a notch that leaves two lags in the place of a mode, and damping ratios of modes.
WIDTH, DAMPINGS = 2.0, (0.01, 0.03, 0.1)


def simc(plants: Sequence[_core.LoopPlant], dt: float) -> list[dict[str, float]]:
    """Gains of a PI law by Skogestad's rule for a lag with a delay, and shares of them.

    ``Kp = T / (k 2 theta)``, ``Ti = min(T, 8 theta)``: Skogestad 2003, doi
    10.1016/S0959-1524(02)00062-8, equations (21) to (24) with the closed loop as slow as the delay.
    The delay theta has half a sampling interval for the hold, and the rule the plant of the highest
    gain.

    Parameters
    ----------
    plants : sequence of LoopPlant
        Plants of the set.
    dt : float
        Sampling interval [s].

    Returns
    -------
    list of dict
        Gains a sample ``kp`` and ``ki`` [V/m].
    """
    plant = max(plants, key=lambda one: abs(one.static_gain))
    delay = plant.matrices()[-1] + 0.5 * dt
    gain, time = nominal_of(plant)
    lag = max(time - plant.matrices()[-1], 0.1 * delay)
    kp = lag / (abs(gain) * 2.0 * delay)
    ki = kp * dt / min(lag, 8.0 * delay)
    return [{"kp": share * kp, "ki": share * ki} for share in SHARES]


def damped(
    law: str, plants: Sequence[_core.LoopPlant], modes: tuple[float, float] | None, dt: float
) -> list[dict[str, float]]:
    """Gains by the rule of `simc` with the damping filter of a law, and with next to none of it.

    An integral resonant control has twice the static gain as its feedthrough, and its pole at
    ``2^(1/4)`` times the mode, where the damping of a mode without any is largest. A filter of
    second order puts the poles of the mode and its own at one place, of damping ratio 0.4: as
    Bhikkaji and others 2007 place them, which for a mode without damping takes no velocity.

    Parameters
    ----------
    law : str
        Name of a law that damps.
    plants : sequence of LoopPlant
        Plants of the set.
    modes : (float, float) or None
        Lowest and highest frequency of the modes that ring [Hz].
    dt : float
        Sampling interval [s].

    Returns
    -------
    list of dict
        Settings by name.
    """
    largest = max(abs(one.static_gain) for one in plants)
    mode = 0.02 / dt if modes is None else modes[0]
    if law == "integral-resonant":
        damping = {"damping": 0.5 / largest, "damping_frequency": 2.0**0.25 * mode}
    else:
        square = 1.0 + 4.0 * WANTED**2
        damping = {
            "damping": (1.0 - 1.0 / square) / largest,
            "damping_velocity": 0.0,
            "damping_frequency": math.sqrt(square) * mode,
            "damping_ratio": 2.0 * WANTED / math.sqrt(square),
        }
    slow = [{name: one / 4.0 for name, one in gains.items()} for gains in simc(plants, dt)]
    least = {**damping, "damping": 1e-4 / largest}
    return [gains | filters for gains in (*simc(plants, dt), *slow) for filters in (damping, least)]


def cancelled(
    gains: Sequence[dict[str, float]], modes: tuple[float, float]
) -> list[dict[str, float]]:
    """Add a wide notch at a mode to some gains, with the depths that cancel usual dampings of it.

    Parameters
    ----------
    gains : sequence of dict
        Settings by name.
    modes : (float, float)
        Lowest and highest frequency of the modes that ring [Hz].

    Returns
    -------
    list of dict
        Settings by name.
    """
    middle = math.sqrt(modes[0] * modes[1])
    notches = [
        {"notch_frequency": middle, "notch_width": WIDTH, "notch_depth": 2.0 * ratio / WIDTH}
        for ratio in DAMPINGS
    ]
    return [one | notch for one in gains for notch in notches]


def place_of(
    settings: Mapping[str, float], ranges: Sequence[tuple[str, float, float, bool]]
) -> list[float]:
    """Place of some settings in the unit box of the ranges; the others as if absent.

    Parameters
    ----------
    settings : mapping
        Values by name.
    ranges : sequence of (str, float, float, bool)
        Name, lower and upper end of each setting, and whether its scale is logarithmic.

    Returns
    -------
    list of float
        One for each range, 0 to 1.
    """

    def place(name: str, low: float, high: float, logarithmic: bool) -> float:
        if name not in settings:
            return ABSENT.get(name, 0.5)
        value = min(max(settings[name], low), high)
        if logarithmic:
            return math.log(value / low) / math.log(high / low)
        return (value - low) / (high - low)

    return [place(*one) for one in ranges]
