"""The two identifications: the paper's search, and the Dahl model on a measured log."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from kernels import equilibrium, lane_costs, massless, slopes
from numba import njit
from scipy.integrate import solve_ivp

import piezotrack as pt
from piezotrack.xu_li_2010.experiments.procedure import SEARCH_BOX

if TYPE_CHECKING:
    from collections.abc import Callable

Array = np.ndarray[Any, np.dtype[np.float64]]
NAMES = ("mass", "damping", "stiffness", "piezo_coefficient", "a1", "a2", "b1")
# A candidate counts as the minimum where its cost is at most this much above the lowest: more than
# the differences between integrators.
NEAR = 1e-3


@dataclass(frozen=True, eq=False)
class Problem:
    """A record, and the box of the parameters that are searched."""

    name: str
    title: str
    log: pt.Dataset
    bounds: dict[str, tuple[float, float]]
    fixed: dict[str, float]
    offset: bool
    # Arguments with which `pt.identify` searches the same.
    arguments: dict[str, Any]
    # Method and relative tolerance of `solve_ivp`: the fastest that is near enough, and exact; both
    # without the mass where that does not matter.
    quick: tuple[str, float]
    exact: tuple[str, float]
    light: bool
    up: float = 30.0

    @property
    def size(self) -> int:
        """Number of parameters that are searched."""
        return len(self.bounds)

    @cached_property
    def record(self) -> tuple[Array, Array, int, float]:
        """Drive [V], displacement [m], first sample that counts, sampling interval [s]."""
        full, first = self.log.full, self.log.warmup
        end = first + self.log.u.size
        return full.u[:end], full.y[:end], first, self.log.dt

    def stages(self, units: Array) -> Array:
        """Rows for the kernels from points of the unit cube, shape (points, size).

        As in piezotrack's own search, what spans two decades or more is searched on a logarithmic
        scale.
        """
        rows = np.empty((len(units), len(NAMES)))
        for i, name in enumerate(NAMES):
            if name in self.fixed:
                rows[:, i] = self.fixed[name]
                continue
            low, high = self.bounds[name]
            part = np.clip(units[:, list(self.bounds).index(name)], 0.0, 1.0)
            wide = low > 0.0 and high >= 100.0 * low
            rows[:, i] = low * (high / low) ** part if wide else low + (high - low) * part
        rows[:, 6] *= self.up
        return rows

    def deviations(self, stages: Array, kernel: Callable[..., Array] = lane_costs) -> Array:
        """Deviations from the record [m], shape (samples that count, stages)."""
        kept = np.empty((self.log.u.size, len(stages)))
        kernel(stages, *self.record, False, kept)
        return kept

    def row(self, model: pt.DahlStage) -> Array:
        """A stage as a row for the kernels."""
        row = np.array([getattr(model, name) for name in NAMES])
        row[6] *= model.up
        return row

    def displacement(self, row: Array, method: str, rtol: float) -> Array:
        """Motion of a stage by `solve_ivp`; NaN where it diverges or the solver gives up."""
        u, _, _, dt = self.record
        x, force, slope = equilibrium(row, u[0])
        times = np.arange(u.size) * dt
        # Tolerances in the size of displacement, velocity, force and its slope.
        stroke = self.log.stroke
        size = np.array([stroke, stroke / 0.1, row[2] * stroke, row[2]])
        lost = np.full(u.size, np.nan)
        try:
            found = solve_ivp(
                derivative,
                (0.0, times[-1]),
                [x, 0.0, force, slope],
                method=method,
                t_eval=times,
                rtol=rtol,
                atol=rtol * size,
                args=(u, dt, tuple(row), self.light, 1e3 * stroke),
            )
        except ArithmeticError:
            return lost
        return found.y[0] if found.success else lost

    def cost(self, x: Array) -> float:
        """Root mean square of the residual of a motion [um]."""
        _, y, first, _ = self.record
        residual = (x - y)[first:]
        if self.offset:
            residual = residual - residual.mean()
        return float(1e6 * np.sqrt(np.mean(residual**2)))


@njit(cache=True)
def derivative(
    t: float,
    state: Array,
    u: Array,
    dt: float,
    stage: tuple[float, ...],
    light: bool,
    far: float,
) -> Array:
    """Right-hand side under a drive that goes straight from sample to sample."""
    x, v, force, slope = state
    if not abs(x) < far:
        raise ArithmeticError
    k = min(max(int(t / dt), 0), u.size - 2)
    drive = u[k] + (u[k + 1] - u[k]) * (t / dt - k)
    if light:
        return np.array(massless(x, v, force, slope, drive, stage))
    return np.array(slopes(x, v, force, slope, drive, stage))


def paper() -> Problem:
    """Table 1 under the paper's drive, with the noise and the steps of its sensor."""
    t = np.arange(20001) / 5000.0
    u = 37.5 * (1.0 - np.cos(2.0 * np.pi * 0.25 * t))
    stage = pt.DahlStage.xu_li_2010()
    x = stage.simulate(u, 1 / 5000.0).x
    noisy = x + np.random.default_rng(1).normal(0.0, 0.097e-6, t.size)
    step = 2.5e-3 / 2**16
    held = {"a1": stage.a1, "a2": stage.a2, "b1": stage.b1}
    asked = {"parameters": {**SEARCH_BOX, **held}, "offset": False}
    return Problem(
        name="paper",
        title="The paper's search: 4 parameters, 20 001 samples",
        log=pt.Dataset(u=u, y=step * np.round(noisy / step), dt=1 / 5000.0),
        bounds=dict(SEARCH_BOX),
        fixed=held,
        offset=False,
        arguments={"model": "dahl", "history": "virgin", **asked},
        quick=("Radau", 1e-4),
        exact=("DOP853", 1e-10),
        light=False,
    )


def measured() -> Problem:
    """The Dahl model on a measured log, with all parameters that the log shows."""
    log = pt.datasets.dbo_training()[3.0:23.0]
    short = pt.ParticleSwarm(particles=2, iterations=1, polish=False)
    fit = pt.identify(log, "dahl", history="virgin", method=replace(short, runs=1))
    # piezotrack holds the stiffness, which is the scale, and a mass too small to matter.
    found = {name: fit.parameters[name] for name in NAMES}
    return Problem(
        name="log",
        title="The measured log: 5 parameters, 4600 samples",
        log=log,
        bounds={name: e.bounds for name, e in found.items() if e.free and e.bounds},
        fixed={name: e.value for name, e in found.items() if not e.free},
        offset=True,
        arguments={"model": "dahl", "history": "virgin"},
        quick=("LSODA", 1e-6),
        exact=("DOP853", 1e-10),
        light=True,
    )
