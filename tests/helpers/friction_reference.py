"""Slow, independent solution of the Dahl stage with dry friction, b0 other than 0, by SciPy.

``M x'' + D x' + K x = T u - b1 q1 - s b0 q2``, with s the sign of x': the paper's (2), (7), (8).
Each leg between reversals is integrated on its own with s held. Where the velocity reaches zero
the forces decide: the stage sticks while they are smaller than b0 q2, and the instant at which
it breaks away is solved for, the drive being a straight line between samples.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from reference import DahlStageLike


class _Stage:
    def __init__(self, stage: DahlStageLike) -> None:
        self.s = stage

    def spring(self, y: NDArray[np.float64]) -> float:
        return float(self.s.stiffness * y[0] + self.s.b1 * y[2])

    def grip(self, y: NDArray[np.float64]) -> float:
        return float(self.s.b0 * y[3])

    def leg(
        self, t: float, end: float, y: NDArray[np.float64], u: float, slope: float, sign: float
    ) -> tuple[float, NDArray[np.float64], bool]:
        """Advance in one direction to the reversal or the end."""
        s = self.s

        def rhs(time: float, y: NDArray[np.float64]) -> list[float]:
            x, v, q1, q2 = y
            drive = s.piezo_coefficient * (u + slope * time)
            force = s.b1 * q1 + sign * s.b0 * q2
            a = (drive - s.damping * v - s.stiffness * x - force) / s.mass
            return [v, a, q2 * v, (s.up - s.a2 * q1 - sign * s.a1 * q2) * v]

        solution = solve_ivp(
            rhs,
            (t, end),
            y,
            method="DOP853",
            rtol=1e-11,
            atol=[1e-17, 1e-14, 1e-18, 1e-14],
            dense_output=True,
            max_step=(end - t) / 8,
        )
        fine = np.linspace(t, end, 65)
        v = sign * solution.sol(fine)[1]
        # The first interval may begin at rest.
        against = np.flatnonzero(v[1:] < 0.0)
        if against.size == 0:
            return end, solution.y[:, -1], False
        k = int(against[0])
        low, high = fine[k], fine[k + 1]
        if sign * solution.sol(low)[1] <= 0.0:
            return float(low), np.asarray(solution.sol(low)), True
        turn = brentq(lambda time: solution.sol(time)[1], low, high, xtol=1e-16)
        y = np.array(solution.sol(turn))
        y[1] = 0.0
        return float(turn), y, True

    def decide(self, t: float, y: NDArray[np.float64], u: float, slope: float, now: float) -> float:
        """Direction in which a stage at rest leaves; 0 where it sticks."""
        pull = self.s.piezo_coefficient * (u + slope * t) - self.spring(y)
        grip = self.grip(y)
        scale = abs(self.spring(y)) + abs(self.s.piezo_coefficient * u)
        if abs(pull) <= grip + 1e-11 * scale:
            return 0.0
        if grip < 0.0 and abs(pull) < -grip and now != 0.0:
            return now
        return 1.0 if pull > 0.0 else -1.0

    def interval(
        self, y: NDArray[np.float64], sign: float, u: float, slope: float, dt: float
    ) -> tuple[NDArray[np.float64], float]:
        """Advance by one sampling interval."""
        t = 0.0
        while t < dt:
            if sign == 0.0:
                sign = self.decide(t, y, u, slope, 0.0)
            if sign == 0.0:
                rate = self.s.piezo_coefficient * slope
                toward = 1.0 if rate >= 0.0 else -1.0
                pull = self.s.piezo_coefficient * (u + slope * t) - self.spring(y)
                room = self.grip(y) - toward * pull
                if rate == 0.0 or t + room / abs(rate) >= dt:
                    return y, 0.0
                t, sign = t + max(room, 0.0) / abs(rate), toward
                continue
            t, y, turned = self.leg(t, dt, y, u, slope, sign)
            if turned:
                sign = self.decide(t, y, u, slope, sign)
        return y, sign


def friction_reference(
    stage: DahlStageLike, u: NDArray[np.float64], dt: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return displacement and velocity at the samples, from rest, under first-order hold."""
    of = _Stage(stage)
    y, sign = np.zeros(4), 0.0
    states = np.zeros((len(u), 4))
    for k in range(len(u) - 1):
        y, sign = of.interval(y, sign, float(u[k]), float((u[k + 1] - u[k]) / dt), dt)
        states[k + 1] = y
    return states[:, 0], states[:, 1]
