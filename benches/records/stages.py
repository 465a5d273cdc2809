"""Stages that the package did not make: hysteresis, creep and a mode, in numpy alone.

The hysteresis acts on the drive divided by its largest value, v in [-1, 1]; the stage has never
moved before, and is in equilibrium at 0. Creep follows what the hysteresis puts out, and a mode
follows both. Between two samples of a record the drive is a straight line, which is stepped
through finely.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# From the drive to the displacement before creep and mode; the second number is the time [s]
# between two values of the drive.
Hysteresis = Callable[[Array, float], Array]

FINE = 1e-4  # a part of a sampling interval [s], at most
LEVELS = 240  # thresholds of a relay


@dataclass(frozen=True)
class Stage:
    """A stage; `simulate` gives its motion [m]."""

    kind: str
    hysteresis: Hysteresis
    creep: tuple[tuple[float, float], ...]  # share and time constant [s]
    frequency: float  # of the mode [Hz]
    damping: float
    largest: float  # drive [V] at v = 1
    gain: float  # displacement [m] for 1 of the hysteresis

    def simulate(self, u: Array, dt: float) -> Array:
        """Simulate the displacement [m] at the samples of a drive [V].

        Until the first sample the stage is in equilibrium at 0 V; a drive that begins elsewhere
        jumps there, and the first reading is still that of rest.
        """
        parts = math.ceil(dt / FINE)
        fine = np.interp(np.arange((len(u) - 1) * parts + 1) / parts, np.arange(len(u)), u)
        step = dt / parts
        force = self.hysteresis(np.concatenate([[0.0], fine]) / self.largest, step)
        force = force[1:] - force[0]
        force = force + sum(share * relaxed(force, step, tau) for share, tau in self.creep)
        return self.gain * oscillator(force, step, self.frequency, self.damping)[::parts]


def relaxed(x: Array, dt: float, tau: float) -> Array:
    """Follow a signal by a first-order lag from 0, exactly for straight lines in between."""
    decay = math.exp(-dt / tau)
    late = tau / dt * (1.0 - decay)
    state, out = 0.0, np.zeros(len(x))
    for i in range(1, len(x)):
        state = decay * state + (1.0 - late) * x[i] + (late - decay) * x[i - 1]
        out[i] = state
    return out


def oscillator(force: Array, dt: float, frequency: float, damping: float) -> Array:
    """Follow a force by a mode of gain 1 from rest at 0, exactly for straight lines in between."""
    w = 2.0 * math.pi * frequency
    pole = complex(-damping * w, w * math.sqrt(1.0 - damping**2))
    # One complex pole: x'' + 2 d w x' + w^2 x = w^2 f is the real part of q' = p q + c f.
    c = w**2 / (1j * pole.imag)
    e = np.exp(pole * dt)
    whole = (e - 1.0) / pole
    later = (whole - dt) / (pole * dt)
    q, out = 0j, np.empty(len(force))
    out[0] = 0.0
    for i in range(1, len(force)):
        q = e * q + c * ((whole - later) * force[i - 1] + later * force[i])
        out[i] = q.real
    return out


def relays(rng: np.random.Generator) -> Hysteresis:
    """Make a plane of relays whose density is random in cells, and even within a cell.

    Preisach's operator (Mayergoyz 1991), by the integral of the density over the triangle of the
    relays that lie between two voltages; within a cell of that table it is interpolated, which
    leaves no staircase.
    """
    nodes = np.linspace(-1.0, 1.0, LEVELS + 1)
    mid = 0.5 * (nodes[1:] + nodes[:-1])
    up, down = np.meshgrid(mid, mid, indexing="ij")
    rough = np.kron(rng.gamma(2.0, 0.5, (12, 12)), np.ones((LEVELS // 12, LEVELS // 12)))
    width, tilt = rng.uniform(0.3, 0.8), rng.uniform(-0.3, 0.3)
    density = rough * np.exp(-(up - down) / width) * (1.0 + tilt * (up + down))
    density = np.where(up > down, density, 0.0) + 0.5 * np.diag(np.diag(density))
    # table[i, j]: relays switched on below nodes[i] and off above nodes[j].
    table = np.zeros((LEVELS + 1, LEVELS + 1))
    table[1:, :-1] = np.cumsum(np.cumsum(density, axis=0)[:, ::-1], axis=1)[:, ::-1]
    table *= rng.uniform(0.6, 1.2) / table[-1, 0]

    mass = table.tolist()

    def between(high: float, low: float) -> float:
        a, b = (0.5 * LEVELS * (1.0 + min(max(x, -1.0), 1.0)) for x in (high, low))
        i, j = min(int(a), LEVELS - 1), min(int(b), LEVELS - 1)
        a, b = a - i, b - j
        # Cells on the diagonal are halves.
        if i == j:
            return float(mass[i + 1][i] * (a - b) ** 2)
        upper = (1.0 - b) * mass[i + 1][j] + b * mass[i + 1][j + 1]
        lower = (1.0 - b) * mass[i][j] + b * mass[i][j + 1]
        halves = a * (1.0 - a) * mass[i + 1][i] + b * (1.0 - b) * mass[j + 1][j]
        return float(a * upper + (1.0 - a) * lower - halves)

    def hysteresis(v: Array, dt: float) -> Array:  # noqa: ARG001
        # Each turn of the drive and the output there: first what demagnetises, an alternating
        # drive of falling amplitude.
        turns = [(-1.0, 0.0)]
        for k, height in enumerate(np.linspace(1.0, 0.0, 400, endpoint=False).tolist()):
            turns.append(_branch(turns, -height if k % 2 else height, between))
        rest = _branch(turns, 0.0, between)[1]
        heading, last, out = 1, 0.0, np.zeros(len(v))
        for i, value in enumerate(v.tolist()):
            if value != last and (value > last) != (heading > 0):
                turns.append((last, rest + out[i - 1]))
                heading = -heading
            # Turns that the drive passes are forgotten, in pairs.
            while len(turns) > 2 and heading * (value - turns[-2][0]) >= 0.0:
                del turns[-2:]
            last = value
            out[i] = _branch(turns, value, between)[1] - rest
        return 0.6 * v + out

    return hysteresis


def _branch(
    turns: list[tuple[float, float]], value: float, between: Callable[[float, float], float]
) -> tuple[float, float]:
    """Return a drive and the output there, on the branch from the last turn."""
    turn, output = turns[-1]
    if value >= turn:
        return value, output + 2.0 * between(value, turn)
    return value, output - 2.0 * between(turn, value)


def _plays(v: Array, thresholds: Array, weights: Array) -> Array:
    """Sum play operators; thresholds of shape (n,), or (len(v), n) where they vary."""
    state, out = np.zeros(len(weights)), np.empty(len(v))
    low, high = v[:, None] - thresholds, v[:, None] + thresholds
    for i in range(len(v)):
        state = np.minimum(np.maximum(state, low[i]), high[i])
        out[i] = weights @ state
    return out


def _density(rng: np.random.Generator, n: int = 60) -> tuple[Array, Array]:
    """Draw thresholds up to 0.6 to 0.9 of the largest drive, and weights that fall unevenly."""
    thresholds = np.sort(rng.uniform(0.0, rng.uniform(0.6, 0.9), n))
    weights = np.exp(-thresholds / rng.uniform(0.1, 0.4)) * rng.gamma(2.0, 0.5, n)
    return thresholds, weights * rng.uniform(0.2, 0.45) / weights.sum()


def generalised_plays(rng: np.random.Generator) -> Hysteresis:
    """Make plays between envelopes tanh(b v + c), saturating (Al Janaideh, Rakheja, Su 2009)."""
    thresholds, weights = _density(rng)
    b = rng.uniform(0.6, 1.3)
    c = rng.uniform(-0.3, 0.3)

    def hysteresis(v: Array, dt: float) -> Array:  # noqa: ARG001
        envelope = (np.tanh(b * v + c) - math.tanh(c)) / b
        return 0.6 * envelope + _plays(envelope, thresholds, weights)

    return hysteresis


def bouc_wen(rng: np.random.Generator) -> Hysteresis:
    """Make a Bouc-Wen hysteresis with an exponent from 1 to 2, by RK4 along the drive."""
    n = rng.uniform(1.0, 2.0)
    beta = rng.uniform(1.5, 5.0)
    gamma = rng.uniform(-0.2, 0.3) * beta
    share = rng.uniform(0.2, 0.38)

    def hysteresis(v: Array, dt: float) -> Array:  # noqa: ARG001
        z, out = 0.0, np.zeros(len(v))

        def slope(z: float, sign: float) -> float:
            return 1.0 - math.pow(abs(z), n) * (beta * sign * math.copysign(1.0, z) + gamma)

        dv = np.diff(v).tolist()
        for i, whole in enumerate(dv):
            if whole != 0.0:
                # A step of a staircase is long: in parts.
                parts = math.ceil(abs(whole) / 0.005)
                d, sign = whole / parts, math.copysign(1.0, whole)
                for _ in range(parts):
                    k1 = slope(z, sign)
                    k2 = slope(z + 0.5 * d * k1, sign)
                    k3 = slope(z + 0.5 * d * k2, sign)
                    k4 = slope(z + d * k3, sign)
                    z += d * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
            out[i + 1] = z
        return v - share * out

    return hysteresis


def rate_dependent_plays(rng: np.random.Generator) -> Hysteresis:
    """Make plays whose thresholds grow with the rate of the drive, by up to a half or all."""
    thresholds, weights = _density(rng)
    growth = rng.uniform(0.5, 1.0)
    reference = 2.0 * math.pi * rng.uniform(10.0, 30.0)  # rate of a sine of that many Hz [1/s]

    def hysteresis(v: Array, dt: float) -> Array:
        rate = np.abs(np.diff(v, prepend=v[0])) / dt
        rate[1] = 0.0  # a jump before the record
        wider = 1.0 + growth * np.tanh(rate / reference)
        return 0.7 * v + _plays(v, thresholds * wider[:, None], weights)

    return hysteresis


def asymmetric_plays(rng: np.random.Generator) -> Hysteresis:
    """Make plays before dead zones (Kuhnen 2003), or beside a square of the drive."""
    thresholds, weights = _density(rng)
    if rng.random() < 0.5:
        bend = rng.uniform(0.1, 0.25) * rng.choice([-1.0, 1.0])

        def square(v: Array, dt: float) -> Array:  # noqa: ARG001
            x: Array = 0.7 * v + bend * v**2 + _plays(v, thresholds, weights)
            return x

        return square
    edges = np.array([-0.6, -0.3, -0.1, 0.1, 0.3, 0.6]) + rng.uniform(-0.08, 0.08, 6)
    gains = rng.uniform(-0.1, 0.25, 6)

    def dead_zones(v: Array, dt: float) -> Array:  # noqa: ARG001
        x = 0.7 * v + _plays(v, thresholds, weights)
        beyond = np.where(
            edges > 0.0, np.maximum(x[:, None] - edges, 0.0), np.minimum(x[:, None] - edges, 0.0)
        )
        y: Array = x + beyond @ gains
        return y

    return dead_zones


KINDS: dict[str, Callable[[np.random.Generator], Hysteresis]] = {
    "relays": relays,
    "generalised plays": generalised_plays,
    "Bouc-Wen": bouc_wen,
    "rate-dependent plays": rate_dependent_plays,
    "asymmetric plays": asymmetric_plays,
}


def draw(kind: str, rng: np.random.Generator, largest: float) -> Stage:
    """Draw a stage of a kind: two of three creep, all have a mode of 100 to 400 Hz."""
    hysteresis = KINDS[kind](rng)
    constants = np.exp(rng.uniform(math.log(0.03), math.log(3.0), rng.integers(1, 4)))
    shares = rng.uniform(0.01, 0.04, len(constants))
    creeps = rng.random() < 2.0 / 3.0
    return Stage(
        kind,
        hysteresis,
        tuple(zip(shares.tolist(), constants.tolist(), strict=True)) if creeps else (),
        frequency=rng.uniform(100.0, 400.0),
        damping=rng.uniform(0.02, 0.2),
        largest=largest,
        gain=rng.uniform(3e-6, 60e-6),
    )
