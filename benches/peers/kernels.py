"""Simulation of a Dahl stage in numba, as a peer's user would write it after some thought.

One row of `stages` is M, D, K, T, a1, a2 and b1 up; b0 is 0. The state is x, x', the hysteresis
force F = b1 q1 and its slope dF/dx. Costs are the rms deviation from the record from sample `first`
on, less its mean where `offset` is true, and infinite where the motion does not stay finite. The
deviations go to `kept`, samples by stages, where it has room.

- `rk4_costs`: what one writes first. Classical Runge-Kutta steps, as many in a sampling interval as
  keep a stage stable, and without the mass where it is too small to matter; stages are shared out
  over the threads.
- `exponential_costs`: the linear part exact over a sample, the force extrapolated along its slope,
  the operator exact in the displacement: one step a sample, whatever the damping.
- `lane_costs`: the same for eight stages in lockstep, which the compiler turns into vectors.

`fastmath` allows fused multiply-adds and nothing else: NaN and infinity keep their meaning.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

LANES = 8
SETTINGS = {"cache": True, "fastmath": {"contract"}, "error_model": "numpy"}
NONE = np.empty((0, 1))


@njit(inline="always", **SETTINGS)
def along(force, slope, move, a1, a2, gain):
    """Force and slope further along the path: the exact flow's power series to four terms."""
    d2 = gain - a2 * force - a1 * slope
    d3 = -a2 * slope - a1 * d2
    d4 = -a2 * d2 - a1 * d3
    half, third, quarter = 0.5 * move, (1.0 / 3.0) * move, 0.25 * move
    force += move * (slope + half * (d2 + third * (d3 + quarter * d4)))
    slope += move * (d2 + half * (d3 + third * d4))
    return force, slope


@njit(**SETTINGS)
def equilibrium(stage, volts):
    """Displacement, force and slope at rest under a voltage, on the virgin branch."""
    stiffness, piezo, a1, a2, gain = stage[2], stage[3], stage[4], stage[5], stage[6]
    load = piezo * volts
    signed = a1 if load >= 0.0 else -a1
    longest = abs(load) / stiffness / 24.0
    x = force = slope = 0.0
    for _ in range(64):
        rest = load - stiffness * x - force
        tangent = stiffness + slope
        move = rest / tangent if tangent > 0.0 else rest / stiffness
        move = min(max(move, -longest), longest)
        force, slope = along(force, slope, move, signed, a2, gain)
        x += move
    return x, force, slope


@njit(**SETTINGS)
def propagator(stage, dt):
    """Exact step of M x'' + D x' + K x = f0 + f1 s, s from 0 to 1, on x and dt x'."""
    mass, damping, stiffness = stage[0], stage[1], stage[2]
    # Exponential of the matrix of x, dt x', f0 and f1, by scaling and squaring.
    a = np.zeros((4, 4))
    a[0, 1] = 1.0
    a[1, 0] = -dt * dt * stiffness / mass
    a[1, 1] = -dt * damping / mass
    a[1, 2] = dt * dt / mass
    a[2, 3] = 1.0
    norm = max(np.abs(a[1]).sum(), 1.0)
    halvings = 0
    while norm > 0.25 and halvings < 100:
        norm *= 0.5
        halvings += 1
    a /= 2.0**halvings
    step = np.eye(4)
    for k in range(12, 0, -1):
        step = np.eye(4) + product(a, step) / k
    for _ in range(halvings):
        step = product(step, step)
    return step[:2].copy()


@njit(**SETTINGS)
def product(a, b):
    """Matrix product of 4 by 4, without the call of a library."""
    out = np.zeros((4, 4))
    for i in range(4):
        for j in range(4):
            for k in range(4):
                out[i, j] += a[i, k] * b[k, j]
    return out


@njit(**SETTINGS)
def root_mean_square(squares, total, count, offset):
    mean = squares / count
    if offset:
        mean -= (total / count) ** 2
    # NaN fails the comparison too.
    return math.sqrt(max(mean, 0.0)) if mean < math.inf else math.inf


@njit(inline="always", **SETTINGS)
def slopes(x, v, force, slope, drive, stage):
    """Time derivatives of the state."""
    mass, damping, stiffness, piezo, a1, a2, gain = stage
    acceleration = (piezo * drive - force - damping * v - stiffness * x) / mass
    signed = a1 if v >= 0.0 else -a1
    return v, acceleration, slope * v, (gain - a2 * force - signed * slope) * v


@njit(inline="always", **SETTINGS)
def massless(x, _, force, slope, drive, stage):
    """Time derivatives where the inertia does not matter."""
    _, damping, stiffness, piezo, a1, a2, gain = stage
    v = (piezo * drive - force - stiffness * x) / damping
    signed = a1 if v >= 0.0 else -a1
    return v, 0.0, slope * v, (gain - a2 * force - signed * slope) * v


@njit(inline="always", **SETTINGS)
def rk4_step(of, x, v, f, s, u0, u1, h, stage):
    """One step under a drive that goes straight from `u0` to `u1`."""
    um, g, e = 0.5 * (u0 + u1), 0.5 * h, h / 6.0
    x1, v1, f1, s1 = of(x, v, f, s, u0, stage)
    x2, v2, f2, s2 = of(x + g * x1, v + g * v1, f + g * f1, s + g * s1, um, stage)
    x3, v3, f3, s3 = of(x + g * x2, v + g * v2, f + g * f2, s + g * s2, um, stage)
    x4, v4, f4, s4 = of(x + h * x3, v + h * v3, f + h * f3, s + h * s3, u1, stage)
    x += e * (x1 + 2.0 * (x2 + x3) + x4)
    v += e * (v1 + 2.0 * (v2 + v3) + v4)
    f += e * (f1 + 2.0 * (f2 + f3) + f4)
    s += e * (s1 + 2.0 * (s2 + s3) + s4)
    return x, v, f, s


@njit(**SETTINGS)
def rk4_cost(stage, u, y, first, dt, offset, kept, i):
    p = (stage[0], stage[1], stage[2], stage[3], stage[4], stage[5], stage[6])
    light = stage[0] < 1e-3 * dt * stage[1]
    # Stable up to 2.785 over the rate; hysteresis may double the stiffness.
    rate = 2.0 * stage[2] / stage[1] if light else stage[1] / stage[0]
    steps = max(1, math.ceil(dt * rate / 2.5))
    x, f, s = equilibrium(stage, u[0])
    v = total = squares = 0.0
    for k in range(u.size):
        if k >= first:
            away = x - y[k]
            total += away
            squares += away * away
            if kept.size > 0:
                kept[k - first, i] = away
        if k + 1 == u.size:
            break
        rise = (u[k + 1] - u[k]) / steps
        for j in range(steps):
            u0 = u[k] + rise * j
            if light:
                x, v, f, s = rk4_step(massless, x, v, f, s, u0, u0 + rise, dt / steps, p)
            else:
                x, v, f, s = rk4_step(slopes, x, v, f, s, u0, u0 + rise, dt / steps, p)
    return root_mean_square(squares, total, u.size - first, offset)


@njit(parallel=True, **SETTINGS)
def rk4_costs(stages, u, y, first, dt, offset, kept):
    costs = np.empty(len(stages))
    for i in prange(len(stages)):
        costs[i] = rk4_cost(stages[i], u, y, first, dt, offset, kept, i)
    return costs


@njit(**SETTINGS)
def exponential_cost(stage, u, y, first, dt, offset, kept, i):
    p = propagator(stage, dt)
    piezo, a1, a2, gain = stage[3], stage[4], stage[5], stage[6]
    x, force, slope = equilibrium(stage, u[0])
    w = total = squares = 0.0
    pxx, pxw, px0, px1 = p[0]
    pwx, pww, pw0, pw1 = p[1]
    for k in range(u.size):
        if k >= first:
            away = x - y[k]
            total += away
            squares += away * away
            if kept.size > 0:
                kept[k - first, i] = away
        if k + 1 == u.size:
            break
        drive = piezo * u[k]
        f0 = drive - force
        f1 = piezo * u[k + 1] - drive - slope * w
        ahead = pxx * x + pxw * w + px0 * f0 + px1 * f1
        signed = a1 if w >= 0.0 else -a1
        w = pwx * x + pww * w + pw0 * f0 + pw1 * f1
        force, slope = along(force, slope, ahead - x, signed, a2, gain)
        x = ahead
    return root_mean_square(squares, total, u.size - first, offset)


@njit(parallel=True, **SETTINGS)
def exponential_costs(stages, u, y, first, dt, offset, kept):
    costs = np.empty(len(stages))
    for i in prange(len(stages)):
        costs[i] = exponential_cost(stages[i], u, y, first, dt, offset, kept, i)
    return costs


@njit(**SETTINGS)
def lanes_ready(stages, begin, volts, dt):
    """State and coefficients of eight stages: rows of one array, which cannot overlap."""
    rows = np.zeros(18 * LANES)
    for j in range(LANES):
        stage = stages[min(begin + j, len(stages) - 1)]
        p = propagator(stage, dt)
        for i in range(4):
            rows[(6 + i) * LANES + j] = p[0, i]
            rows[(10 + i) * LANES + j] = p[1, i]
            rows[(14 + i) * LANES + j] = stage[3 + i]
        rows[j], rows[2 * LANES + j], rows[3 * LANES + j] = equilibrium(stage, volts)
    return rows


@njit(parallel=True, **SETTINGS)
def lane_costs(stages, u, y, first, dt, offset, kept):
    many, n, keep = len(stages), u.size, kept.size > 0
    costs = np.empty(many)
    for b in prange((many + LANES - 1) // LANES):
        begin = b * LANES
        used = min(LANES, many - begin)
        r = lanes_ready(stages, begin, u[0], dt)
        for k in range(n):
            u0, yk, counts = u[k], y[k], 1.0 if k >= first else 0.0
            u1 = u[min(k + 1, n - 1)] - u0
            if keep and k >= first:
                for j in range(used):
                    kept[k - first, begin + j] = r[j] - yk
            for j in range(LANES):
                x, w = r[j], r[LANES + j]
                force, slope = r[2 * LANES + j], r[3 * LANES + j]
                away = counts * (x - yk)
                r[4 * LANES + j] += away
                r[5 * LANES + j] += away * away
                f0 = r[14 * LANES + j] * u0 - force
                f1 = r[14 * LANES + j] * u1 - slope * w
                ahead = r[6 * LANES + j] * x + r[7 * LANES + j] * w
                ahead += r[8 * LANES + j] * f0 + r[9 * LANES + j] * f1
                signed = r[15 * LANES + j] if w >= 0.0 else -r[15 * LANES + j]
                onward = r[10 * LANES + j] * x + r[11 * LANES + j] * w
                r[LANES + j] = onward + r[12 * LANES + j] * f0 + r[13 * LANES + j] * f1
                force, slope = along(
                    force, slope, ahead - x, signed, r[16 * LANES + j], r[17 * LANES + j]
                )
                r[j], r[2 * LANES + j], r[3 * LANES + j] = ahead, force, slope
        for j in range(used):
            squares, total = r[5 * LANES + j], r[4 * LANES + j]
            costs[begin + j] = root_mean_square(squares, total, n - first, offset)
    return costs
