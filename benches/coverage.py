"""Share of 95 % intervals that cover the truth, by model and noise.

python benches/coverage.py [--records 200] [--models first-order-dahl,bouc-wen] [--json FILE]

Each cell is one stage under nested sines, measured with new noise again and again and identified by
the default call of its model. Beside each mean that of intervals for independent noise.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

import piezotrack as pt

DT, SECONDS, NOISE = 4e-3, 8.0, 50e-9
POLES = {"white": 0.0, "AR 0.8": 0.8, "AR 0.95": 0.95}
THRESHOLDS = [5.0, 15.0, 30.0]
STAGES: dict[str, Any] = {
    "prandtl-ishlinskii": pt.PrandtlIshlinskiiStage(
        linear=0.8e-6, thresholds=THRESHOLDS, weights=[0.1e-6, 0.08e-6, 0.06e-6]
    ),
    "first-order-dahl": pt.FirstOrderDahlStage(
        mass=0.01,
        damping=1e3,
        stiffness=1e6,
        piezo_coefficient=1.0,
        rest_stiffness=2e5,
        coulomb_force=5.0,
    ),
    "dahl": pt.DahlStage.xu_li_2010(),
    "bouc-wen": pt.BoucWenStage(
        mass=0.01,
        damping=1e3,
        stiffness=1e6,
        piezo_coefficient=1e-6,
        alpha=0.3,
        beta=0.1,
        gamma=0.05,
    ),
}
METHODS = {
    "prandtl-ishlinskii": pt.LeastSquares(
        thresholds=THRESHOLDS, creep=False, dynamics=None, dead_zones=0
    )
}
HELD = {"dahl": {"stiffness": 26065.0}}


def drive() -> np.ndarray:
    """Sines of falling amplitude [V]."""
    t = np.arange(0.0, SECONDS, DT)
    return 40.0 + 38.0 * (1.0 - t / SECONDS) * np.sin(2.0 * np.pi * t)


def noise(rng: np.random.Generator, count: int, name: str) -> np.ndarray:
    """Noise of a cell [m]."""
    if name == "white + drift":
        slow = autoregression(rng, count, 0.995, NOISE)
        return 0.6 * NOISE * rng.standard_normal(count) + slow
    return autoregression(rng, count, POLES[name], NOISE)


def autoregression(rng: np.random.Generator, count: int, pole: float, size: float) -> np.ndarray:
    """First-order autoregression of standard deviation `size`."""
    drawn = rng.standard_normal(count + 3000) * size * np.sqrt(1.0 - pole**2)
    series = np.zeros(count + 3000)
    for k in range(1, count + 3000):
        series[k] = pole * series[k - 1] + drawn[k]
    return series[3000:]


def cell(model: str, name: str, records: int) -> dict[str, Any]:
    """Coverage of each value, of a model under a noise."""
    stage, u = STAGES[model], drive()
    rng = np.random.default_rng(1)
    clean = stage.simulate(u, DT, initial=stage.equilibrium(u[0])).x
    hits: dict[str, list[bool]] = {}
    plain: dict[str, list[bool]] = {}
    for _ in range(records):
        log = pt.Dataset(u=u, y=clean + noise(rng, u.size, name), dt=DT)
        fit = pt.identify(
            log, model, history="virgin", method=METHODS.get(model), parameters=HELD.get(model)
        )
        certainty = fit.covariance
        if certainty is None:
            continue
        # Of voltage and displacement only ratios to the stiffness follow.
        scale = getattr(fit.model, "stiffness", 1.0) / getattr(stage, "stiffness", 1.0)
        for k, value in enumerate(certainty.names):
            parameter, _, entry = value.rstrip("]").partition("[")
            true = getattr(stage, parameter)
            true = float(true[int(entry)] if entry else true)
            if fit.scale_assumed and parameter in certainty.names and "N" in _unit(fit, parameter):
                true *= scale
            low, high = certainty.interval(value)
            hits.setdefault(value, []).append(low < true < high)
            reach = 1.96 * certainty.independent[k]
            plain.setdefault(value, []).append(abs(certainty.values[k] - true) < reach)
    shares = {value: float(np.mean(each)) for value, each in hits.items()}
    return {
        "coverage": shares,
        "records": {value: len(each) for value, each in hits.items()},
        "mean": float(np.mean(list(shares.values()))),
        "independent": float(np.mean([np.mean(each) for each in plain.values()])),
    }


def _unit(fit: Any, parameter: str) -> str:
    return next(p.unit for p in fit.model.info.parameters if p.name == parameter)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--records", type=int, default=200)
    parser.add_argument("--models", default=",".join(STAGES))
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    table: dict[str, Any] = {}
    for model in options.models.split(","):
        for name in (*POLES, "white + drift"):
            table[f"{model}, {name}"] = result = cell(model, name, options.records)
            each = ", ".join(f"{v} {100 * c:.0f}" for v, c in result["coverage"].items())
            print(
                f"{model:20s}{name:15s}{100 * result['mean']:6.1f} % "
                f"(independent {100 * result['independent']:.1f}): {each}",
                flush=True,
            )
    if options.json:
        options.json.write_text(json.dumps(table, indent=1))


if __name__ == "__main__":
    main()
