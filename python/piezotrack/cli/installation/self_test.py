"""Calculations whose results have the same bits on every processor and system."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["EXPECTED", "self_test"]

# Of each part, the beginning of SHA-256 over its numbers as bytes, lowest byte first.
EXPECTED = {
    "simulation": "71e94d8e0c6bab62",
    "search": "3d3e7c18e60ae7dd",
    "inverse": "a13574f78868885d",
    "loop": "c003ce06e8a5d8ef",
}
DT = 1e-3
# Ends of the reference [m].
LOW, HIGH = 8e-6, 40e-6


def self_test() -> dict[str, str]:
    """Simulate, search, invert and control, and return a digest of the numbers of each.

    Drive and reference are sums and products, and the rest runs in the compiled core: functions of
    NumPy and of the BLAS may differ in their last digits from one processor to the next.

    Returns
    -------
    dict
        Name of each part and 16 hexadecimal digits: those of `EXPECTED` where all is in order.

    Examples
    --------
    >>> self_test() == EXPECTED
    True
    """
    import piezotrack as pt

    volts = _triangles(4000, 60.0)
    dahl = pt.DahlStage.xu_li_2010()
    plays = pt.stages.PrandtlIshlinskiiStage(
        linear=1e-6, thresholds=(10.0, 20.0), weights=(0.2e-6, 0.1e-6)
    )
    moved = [stage.simulate(volts, DT).x for stage in (dahl, plays)]
    log = pt.Dataset(u=volts, y=moved[0], dt=DT)
    swarm = pt.ParticleSwarm(particles=16, iterations=20, runs=2, seed=1)
    found = pt.identify(log, "dahl", method=swarm)
    reference = pt.references.Reference(
        name="triangle", duration=2.0, low=LOW, high=HIGH, motion=_motion, period=0.5, ramp=0.0
    )
    inverse = pt.stages.Inverse(stage=plays)
    voltages = inverse.table(reference, DT)
    loop = pt.Controller(
        dt=DT, limits=(0.0, 75.0), feedforward=inverse, feedback=pt.Pid(kp=1e5, ti=0.01, td=0.0)
    )
    run = pt.track(plays, loop, reference)
    return {
        "simulation": _digest(*moved),
        "search": _digest(np.array([found.model.stiffness, found.model.damping, found.cost])),
        "inverse": _digest(voltages),
        "loop": _digest(run.displacement, run.voltage),
    }


def _motion(t: Array) -> tuple[Array, Array, Array]:
    """Return triangles of 2 Hz."""
    share = 2.0 * t - np.floor(2.0 * t)
    stroke = HIGH - LOW
    slope = np.where(share < 0.5, 4.0 * stroke, -4.0 * stroke)
    return HIGH - stroke * np.abs(2.0 * share - 1.0), slope, np.zeros_like(t)


def _triangles(samples: int, height: float) -> Array:
    """Return triangles that fall to a third of their height."""
    k = np.arange(samples)
    volts: Array = (
        height * (1.0 - 2.0 * k / (3.0 * samples)) * (1.0 - np.abs(k % 500 - 250.0) / 250)
    )
    return volts


def _digest(*numbers: Array) -> str:
    whole = hashlib.sha256()
    for one in numbers:
        whole.update(np.ascontiguousarray(one, dtype="<f8").tobytes())
    return whole.hexdigest()[:16]
