"""A cell: a stage measured with new noise again and again, and what its intervals cover."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
from noises import RICHER, noise_of, seed_of
from truths import CASES, motion, with_creep

from piezotrack.identification import residual_of

# Parts of a drive that repeats, which tells model error from noise.
TIMES = 4


def value_of(stage: Any, name: str) -> float:
    """A value of a stage by its name in a covariance; NaN where it has none."""
    parameter, _, entry = name.rstrip("]").partition("[")
    value = getattr(stage, parameter, None)
    if value is None:
        return float("nan")
    return float(value[int(entry)] if entry else value)


def measured(case: str, noise: str, records: int, seed: int = 1) -> dict[str, Any]:
    """Measure a cell.

    Of each value: shares that cover the truth, of the intervals and of those for independent noise;
    median stated over actual standard deviation; records that give it an interval.
    """
    of, richer = CASES[case], noise == RICHER
    u = of.drive(TIMES if richer else 1)
    truth = of.truth(u)
    clean = motion(with_creep(truth) if richer and not of.foreign else truth, u, of.dt)
    # What the call makes of the record without noise: what noise alone moves the values from.
    aim = of.fit(u, clean).model if richer else truth
    rng = np.random.default_rng(seed_of(case, noise, seed))
    fits = [of.fit(u, clean + noise_of(noise, rng, u.size, of.noise)) for _ in range(records)]
    values = judged(fits, truth, aim)
    cell: dict[str, Any] = {
        "case": case,
        "noise": noise,
        "records": records,
        "seed": seed,
        "stated": sum(fit.covariance is not None for fit in fits),
        "values": values,
    }
    return cell | (told(fits) if richer else {})


def judged(fits: list[Any], truth: Any, aim: Any) -> dict[str, dict[str, float]]:
    """Coverage of each value."""
    rows: dict[str, list[tuple[float, ...]]] = {}
    for fit in fits:
        certainty = fit.covariance
        if certainty is None:
            continue
        for k, name in enumerate(certainty.names):
            if not certainty.determined[k]:
                continue
            low, high = certainty.interval(name)
            reach = 1.96 * certainty.independent[k]
            row = (certainty.values[k], low, high, reach, certainty.deviations[k])
            rows.setdefault(name, []).append(row)
    values = {}
    for name, each in rows.items():
        value, low, high, reach, stated = np.array(each).T
        at, real = value_of(aim, name), value_of(truth, name)
        spread = float(np.std(value, ddof=1)) if len(value) > 1 else 0.0
        spread = spread or float("nan")
        values[name] = {
            "covered": float(np.mean((low < at) & (at < high))),
            "real": float(np.mean((low < real) & (real < high))),
            "independent": float(np.mean(np.abs(value - at) < reach)),
            "ratio": float(np.median(stated)) / spread,
            "bias": float(np.mean(value - at)) / spread,
            "given": len(value) / len(fits),
        }
    return values


def told(fits: list[Any]) -> dict[str, Any]:
    """Count what the results say of a model that is too simple."""
    certain = [fit.covariance for fit in fits if fit.covariance is not None]
    residuals = [residual_of(fit) for fit in fits]
    shares = [one.shares for one in certain if one.shares is not None]
    return {
        "model error": float(np.median([s.model_error for s in shares])) if shares else None,
        "rest": float(np.median([s.noise for s in shares])) if shares else None,
        "repeats": sum(s.model_error > 0.2 * s.noise for s in shares),
        "decided": sum(bool(one.decided_by_model) for one in certain),
        "coloured": sum(not one.is_white for one in residuals),
        "causes": dict(Counter(str(one.cause) for one in residuals)),
    }
