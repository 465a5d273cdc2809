"""The structure that a fit by least squares chooses, beside what each of its choices named finds.

    python benches/records/choices.py [first seed] [seeds]

Made-up records of six sorts, of plays with random creep, lag or mode, drift and history, made in
numpy alone. Printed for each: rms over the noise of the default, and of the best call with a
history, creep or dynamics named; at the end how many are more than 3 % worse.
"""

from __future__ import annotations

import sys
import time
import warnings
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter, ss2tf

import piezotrack as pt

Array = NDArray[np.float64]

MODEL = "prandtl-ishlinskii"
PLAYS = 25
NAMED: list[dict[str, Any]] = [
    *({"history": history} for history in ("virgin", "settled", "fit")),
    *({"creep": creep} for creep in (True, False)),
    *({"dynamics": dynamics} for dynamics in (None, "first", "second")),
]


class Made(NamedTuple):
    """A record, and its noise [m]."""

    data: pt.Dataset
    noise: float


def drive(rng: np.random.Generator, sort: int, t: Array) -> Array:
    """Return the drive of a sort of record [V]."""
    n, length = t.size, float(t[-1])
    if sort == 0:
        return 50 + 45 * np.sin(2 * np.pi * rng.uniform(2, 12) * t / length - rng.choice([0, 1.57]))
    if sort == 1:
        saw = np.arcsin(np.sin(2 * np.pi * rng.uniform(3, 10) * t / length)) * 2 / np.pi
        return 50 + 40 * np.exp(-t / length) * saw
    if sort == 2:
        levels = rng.uniform(0, 100, int(rng.integers(5, 14)))
        return np.repeat(levels, n // levels.size + 1)[:n]
    if sort == 3:
        rate = rng.uniform(5, 30) / length
        return 50 + 40 * np.sin(2 * np.pi * (t / length + rate * t**2 / (2 * length)))
    if sort == 4:
        lines = np.fft.rfft(rng.normal(size=n))
        lines[np.fft.rfftfreq(n, t[1]) > rng.uniform(5, 20) / length] = 0
        band = np.fft.irfft(lines, n)
        return 50 + 40 * band / np.abs(band).max()
    return 50 - 45 * np.cos(2 * np.pi * rng.uniform(0.8, 1.7) * t / length)


def through_plays(u: Array, start: Array, r: Array, w: Array, linear: float) -> Array:
    """Return the output of plays [m], which begin at `start`."""
    z, out = start.copy(), np.empty(u.size)
    for k, volts in enumerate(u):
        z = np.clip(z, volts - r, volts + r)
        out[k] = linear * volts + w @ z
    return out


def made(seed: int) -> Made:
    """Make the record of a seed."""
    rng = np.random.default_rng(seed)
    sort, dt = seed % 6, 10 ** rng.uniform(-3.3, -2.0)
    t = dt * np.arange(int(rng.integers(1500, 5000)))
    u = drive(rng, sort, t)
    r = np.sort(rng.uniform(0.5, 60, PLAYS))
    density = np.exp(-r / rng.uniform(8, 40))
    share = rng.uniform(0.15, 0.5)
    w, z = share * 1e-6 * density / density.sum(), np.zeros(PLAYS)
    ends = [u.min(), u.max(), u.min(), u.max()]
    for volts in ([], ends, [rng.uniform(-30, 130)])[rng.integers(3)]:
        z = np.clip(z, volts - r, volts + r)
    x = through_plays(u, np.clip(z, u[0] - r, u[0] + r), r, w, (1 - share) * 1e-6)
    if rng.random() < 0.5:
        slow = t[-1] * 10 ** rng.uniform(-1.7, -0.3)
        bare = x
        for weight, tau in ((rng.uniform(0.02, 0.08), slow), (rng.uniform(0.02, 0.06), 5 * slow)):
            a = np.exp(-dt / tau)
            middle = np.concatenate(([0.0], 0.5 * (bare[1:] + bare[:-1]) - bare[0]))
            x = x + weight * (lfilter([1 - a], [1, -a], middle) + bare[0])
    dynamics = rng.integers(3)
    if dynamics == 1:
        late = dt * 10 ** rng.uniform(-0.5, 1)
        e = np.exp(-dt / late)
        held = e if sort == 2 else (1 - e) * late / dt
        x = lfilter([1 - held, held - e], [1, -e], x - x[0]) + x[0]
    elif dynamics == 2 and sort == 3:
        wn, zeta = 2 * np.pi * rng.uniform(0.02, 0.2) / dt, 10 ** rng.uniform(-2, -0.3)
        rows = ([[0, 1], [-(wn**2), -2 * zeta * wn]], [[0], [wn**2]], [[1, 0]], [[0]])
        continuous = tuple(np.array(one, dtype=float) for one in rows)
        b, a = ss2tf(*(np.asarray(one) for one in cont2discrete(continuous, dt, "foh")[:4]))
        x = lfilter(b[0], a, x - x[0]) + x[0]
    if sort == 2:
        # A drive that is held acts after its sample.
        x = np.concatenate((x[:1], x[:-1]))
    stroke = float(np.ptp(x))
    noise = stroke * 10 ** rng.uniform(-4, -2.8)
    y = x + noise * rng.normal(size=t.size) + stroke * rng.uniform(-0.5, 0.5)
    if rng.random() < 0.3:
        y = y + rng.uniform(-0.03, 0.03) * stroke * np.exp(-t / (rng.uniform(0.2, 1) * t[-1]))
    return Made(pt.Dataset(u=u, y=y, dt=dt, hold="zoh" if sort == 2 else "foh"), noise)


def cost(data: pt.Dataset, named: dict[str, Any]) -> float:
    """Return the rms of a fit with some choices named [m]."""
    settings = {name: value for name, value in named.items() if name != "history"}
    method = pt.LeastSquares(**settings)
    history = named.get("history")
    return pt.identify(data, MODEL, method=method, history=history, progress=False).cost


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    first = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 50
    ratios, seconds = [], []
    print("seed  samples   default      best  named")
    for seed in range(first, first + count):
        data, noise = made(seed)
        begun = time.process_time()
        default = cost(data, {})
        seconds.append(time.process_time() - begun)
        costs = [cost(data, named) for named in NAMED]
        best = int(np.argmin(costs))
        ratios.append(default / min(default, costs[best]))
        print(
            f"{seed:4d}  {len(data):7d}  {default / noise:8.2f}  {costs[best] / noise:8.2f}  "
            f"{NAMED[best] if ratios[-1] > 1.03 else ''}",
            flush=True,
        )
    worse = int(np.sum(np.array(ratios) > 1.03))
    print(f"{worse} of {count} more than 3 % worse than the best call with one choice named")
    print(
        f"ratios: median {np.median(ratios):.3f}, 90 % {np.quantile(ratios, 0.9):.3f}, largest "
        f"{max(ratios):.2f}; {np.median(seconds):.1f} s of CPU, at most {max(seconds):.1f} s"
    )


if __name__ == "__main__":
    main()
