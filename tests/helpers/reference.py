"""Slow, independent solution of the Dahl stage by SciPy, and the drives used to test against it.

``M x'' + D x' + K x = T u - b1 q1``, ``q1' = q2 x'``,
``q2' = (up - a2 q1 - sgn(x') a1 q2) x'``: the paper's (2), (7), (8) with b0 = 0.

The right-hand side has a kink at ``x' = 0`` and at every sample. Each smooth leg between them is
integrated on its own, with the sign of ``x'`` held constant, so that the order of the method and
its error control mean what they say.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from scipy.integrate import DOP853, Radau
from scipy.optimize import brentq

if TYPE_CHECKING:
    from numpy.typing import NDArray

Hold = Literal["foh", "zoh"]
Method = Literal["auto", "dop853", "radau"]

# DOP853 is stable for steps up to about 6 M/D. At these tolerances Radau takes so many steps that
# it becomes the faster of the two only where a sample spans more than this many M/D.
STIFF_DECAY_PER_SAMPLE = 1500.0


class DahlStageLike(Protocol):
    """The parameters read from a stage, SI."""

    @property
    def mass(self) -> float: ...
    @property
    def damping(self) -> float: ...
    @property
    def stiffness(self) -> float: ...
    @property
    def piezo_coefficient(self) -> float: ...
    @property
    def a1(self) -> float: ...
    @property
    def a2(self) -> float: ...
    @property
    def b1(self) -> float: ...
    @property
    def b0(self) -> float: ...
    @property
    def up(self) -> float: ...


@dataclass(frozen=True, kw_only=True)
class DahlParameters:
    """A plain set of Dahl parameters; the defaults are Table 1 of the paper."""

    mass: float = 0.1828
    damping: float = 2.5973e3
    stiffness: float = 2.6065e4
    piezo_coefficient: float = 0.0468
    a1: float = 121.9874
    a2: float = 1.1773e6
    b1: float = 1.8485e6
    b0: float = 0.0
    up: float = 30.0


def dahl_reference(
    stage: DahlStageLike,
    u: NDArray[np.float64],
    dt: float,
    hold: Hold = "foh",
    *,
    method: Method = "auto",
    rtol: float = 1e-12,
    max_step: float = np.inf,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return displacement, velocity and hysteresis force at the sample times, from rest.

    Parameters
    ----------
    stage
        The parameters, with ``b0 = 0``.
    u
        Voltage at the samples; between them linear ("foh") or held ("zoh").
    dt
        Sampling interval in s.
    hold
        "foh" or "zoh".
    method
        The integrator; "auto" takes Radau only where ``D/M dt`` is very large.
    rtol
        Relative tolerance of each step; the absolute one is ``rtol`` times the size that each
        component reaches under this drive.
    max_step
        Upper bound of a step in s, to check the convergence.
    """
    if stage.b0 != 0.0:
        raise ValueError("the reference is written for b0 = 0")
    solver = _Legs(stage, float(np.max(np.abs(u), initial=0.0)), dt, method, rtol, max_step)
    n = len(u)
    states = np.zeros((n, 4))
    y = np.zeros(4)
    for k in range(n - 1):
        slope = (u[k + 1] - u[k]) / dt if hold == "foh" else 0.0
        y = solver.sample(y, float(u[k]), float(slope))
        states[k + 1] = y
    return states[:, 0].copy(), states[:, 1].copy(), stage.b1 * states[:, 2]


class _Legs:
    """Integrates one sampling interval, restarted at each reversal."""

    def __init__(
        self,
        stage: DahlStageLike,
        u_max: float,
        dt: float,
        method: Method,
        rtol: float,
        max_step: float,
    ) -> None:
        self.stage = stage
        self.dt = dt
        self.max_step = max_step
        self.rtol = rtol
        decay = stage.damping / stage.mass
        stiff = decay * dt > STIFF_DECAY_PER_SAMPLE
        self.radau = method == "radau" or (method == "auto" and stiff)
        wn2 = stage.stiffness / stage.mass
        x = max(stage.piezo_coefficient * u_max / stage.stiffness, 1e-12)
        v = x * wn2 / max(decay, wn2**0.5)
        self.v_noise = 1e-14 * v
        self.atol = rtol * np.array([x, v, stage.up * x * x, stage.up * x])
        self.first_step = 0.3 / max(decay, wn2**0.5)
        self.step = self.first_step

    def sample(self, y: NDArray[np.float64], u: float, slope: float) -> NDArray[np.float64]:
        """Advance the state by one sampling interval."""
        t, sign = 0.0, self._direction(y, u, slope)
        self.step = min(self.step, self.first_step)
        while t < self.dt:
            t, y = self._leg(t, y, u, slope, sign)
            sign = -sign
        return y

    def _direction(self, y: NDArray[np.float64], u: float, slope: float) -> float:
        """Sign of the velocity just after the start, from the first derivative that is not 0."""
        s = self.stage
        v = float(y[1])
        force = s.piezo_coefficient * u - s.damping * v - s.stiffness * y[0] - s.b1 * y[2]
        for value in (v, float(force), slope):
            if value != 0.0:
                return 1.0 if value > 0.0 else -1.0
        return 1.0

    def _leg(
        self, t: float, y: NDArray[np.float64], u: float, slope: float, sign: float
    ) -> tuple[float, NDArray[np.float64]]:
        """Advance to the next reversal or to the end of the interval."""
        solver = self._solver(t, y, self.dt, u, slope, sign, self.step)
        while solver.status == "running":
            t_old, y_old, a_old = solver.t, solver.y, solver.f[1]
            _advance(solver)
            if solver.status == "running":
                self.step = solver.h_abs
            v_old, v_new, a_new = sign * y_old[1], sign * solver.y[1], sign * solver.f[1]
            if v_new < 0.0:
                after = solver.t
            elif v_old > 0.0 and sign * a_old < 0.0 < a_new:
                after = _closest_to_zero(solver, t_old, a_old, sign)
                if sign * solver.dense_output()(after)[1] >= 0.0:
                    continue
            else:
                continue
            if max(abs(v_old), abs(v_new)) < self.v_noise or v_old <= 0.0:
                return solver.t, solver.y
            dense = solver.dense_output()
            turn = float(brentq(lambda t, dense=dense: dense(t)[1], t_old, after, xtol=1e-18))
            return self._land(t_old, y_old, turn, u, slope, sign)
        return self.dt, solver.y

    def _land(
        self, t: float, y: NDArray[np.float64], turn: float, u: float, slope: float, sign: float
    ) -> tuple[float, NDArray[np.float64]]:
        """Integrate to the reversal itself; the interpolated time is corrected by Newton steps."""
        for _ in range(4):
            if turn <= t or turn >= self.dt:
                break
            solver = self._solver(t, y, turn, u, slope, sign, turn - t)
            while solver.status == "running":
                _advance(solver)
            t, y = turn, solver.y
            if abs(y[1]) < self.v_noise or solver.f[1] == 0.0:
                break
            turn = t - y[1] / solver.f[1]
        return t, y

    def _solver(
        self,
        t: float,
        y: NDArray[np.float64],
        end: float,
        u: float,
        slope: float,
        sign: float,
        step: float,
    ) -> Any:
        s = self.stage
        drive, ramp = s.piezo_coefficient * u / s.mass, s.piezo_coefficient * slope / s.mass
        d, k, b = s.damping / s.mass, s.stiffness / s.mass, s.b1 / s.mass
        a1, a2, up = sign * s.a1, s.a2, s.up

        def rhs(t: float, y: NDArray[np.float64]) -> tuple[float, float, float, float]:
            x, v, q1, q2 = y.tolist()
            acceleration = drive + ramp * t - d * v - k * x - b * q1
            return v, acceleration, q2 * v, (up - a2 * q1 - a1 * q2) * v

        def jac(_: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
            _x, v, q1, q2 = y.tolist()
            return np.array(
                [
                    [0.0, 1.0, 0.0, 0.0],
                    [-k, -d, -b, 0.0],
                    [0.0, q2, 0.0, v],
                    [0.0, up - a2 * q1 - a1 * q2, -a2 * v, -a1 * v],
                ]
            )

        options: dict[str, Any] = {
            "rtol": self.rtol,
            "atol": self.atol,
            "max_step": self.max_step,
            "first_step": min(step, end - t),
        }
        if self.radau:
            return Radau(rhs, t, y, end, jac=jac, **options)
        return DOP853(rhs, t, y, end, **options)


def _advance(solver: Any) -> None:
    message = solver.step()
    if solver.status == "failed":
        raise ArithmeticError(f"the reference failed at t = {solver.t} s: {message}")


def _closest_to_zero(solver: Any, t_old: float, a_old: float, sign: float) -> float:
    """Time inside the last step where the velocity came closest to 0, from the accelerations."""
    a0, a1 = sign * a_old, sign * solver.f[1]
    return float(t_old + (solver.t - t_old) * a0 / (a0 - a1))


def sine(
    n: int, dt: float, frequency: float, *, low: float = 0.0, high: float = 75.0, phase: float = 0.0
) -> NDArray[np.float64]:
    """Return a sine between ``low`` and ``high``; phase 0 starts at ``low``, at rest."""
    angle = 2 * np.pi * frequency * dt * np.arange(n) + phase
    signal: NDArray[np.float64] = low + 0.5 * (high - low) * (1 - np.cos(angle))
    return signal


def triangle(
    n: int, dt: float, frequency: float, *, low: float = 0.0, high: float = 75.0, phase: float = 0.0
) -> NDArray[np.float64]:
    """Return a triangle between ``low`` and ``high``; phase 0 starts at ``low``, rising."""
    turns = frequency * dt * np.arange(n) + phase / (2 * np.pi)
    signal: NDArray[np.float64] = low + (high - low) * (1 - np.abs(2 * (turns % 1.0) - 1))
    return signal


def multisine(
    n: int,
    dt: float,
    frequency: float,
    *,
    low: float = 0.0,
    high: float = 75.0,
    phase: float = 0.0,
    harmonics: tuple[int, ...] = (1, 2, 3, 5, 8),
) -> NDArray[np.float64]:
    """Return a sum of equal harmonics with Schroeder's phases, inside ``low`` to ``high``."""
    angle = 2 * np.pi * frequency * dt * np.arange(n) + phase
    count = len(harmonics)
    total = np.zeros(n)
    for k, harmonic in enumerate(harmonics):
        total += np.cos(harmonic * angle - np.pi * k * (k + 1) / count)
    return 0.5 * (low + high) + 0.5 * (high - low) * total / max(1.0, float(np.abs(total).max()))


def steps(
    n: int, every: int, *, levels: tuple[float, ...] = (75.0, 0.0, 40.0, 10.0, 60.0)
) -> NDArray[np.float64]:
    """Return 0 V and then each of the levels in turn for ``every`` samples."""
    index = np.arange(n) // every
    return np.array([0.0 if i == 0 else levels[(i - 1) % len(levels)] for i in index])
