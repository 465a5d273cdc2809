"""Ten tunings that a laboratory would have."""

from __future__ import annotations

from functools import cache, partial
from typing import TYPE_CHECKING, Any, NamedTuple

import piezotrack as pt
from piezotrack.xu_li_2010.apparatus import LIMITS, Apparatus
from piezotrack.xu_li_2010.experiments.fig_06_identification import record, search

if TYPE_CHECKING:
    from collections.abc import Callable

RANGE = (0.0, 75.0)
PLAYS = pt.PrandtlIshlinskiiStage(
    linear=0.8e-6, thresholds=(2.0, 8.0, 20.0), weights=(2e-7, 1.5e-7, 1e-7)
)
# What an identification made of it.
ROUGH = pt.PrandtlIshlinskiiStage(linear=0.85e-6, thresholds=(3.0, 12.0), weights=(2.4e-7, 1.2e-7))


# The cost of the best known values has no offset of the feedforward; older versions know none.
NO_OFFSET = {"offset": 0.0} if "offset" in pt.Spread.__dataclass_fields__ else {}


class Case(NamedTuple):
    """Arguments of `pt.tune`: stage, reference, and the others by name."""

    name: str
    make: Callable[[], tuple[Any, Any, dict[str, Any]]]


def mode(stage: Any, frequency: float, damping: float) -> Any:
    return pt.PrandtlIshlinskiiStage(
        linear=stage.linear,
        thresholds=stage.thresholds,
        weights=stage.weights,
        frequency=frequency,
        damping_ratio=damping,
    )


def plays(
    frequency: float, damping: float, rate: float, noise: float, reference: Any, **options: Any
) -> tuple[Any, Any, dict[str, Any]]:
    """A stage of plays with one mode; feedforward from a model that is 5 % off."""
    stage = pt.VirtualStage.of(mode(PLAYS, frequency, damping), noise=noise, seed=3)
    if options.pop("inverse", False):
        options["feedforward"] = mode(ROUGH, 1.05 * frequency, damping).inverse()
    options.setdefault("spread", pt.Spread(**NO_OFFSET))
    return stage, reference, {"dt": 1.0 / rate, "limits": RANGE, **options}


def low_high(form: Any, frequency: float, duration: float) -> Any:
    return form(frequency=frequency, low=10e-6, high=50e-6, duration=duration)


def lag_like() -> tuple[Any, Any, dict[str, Any]]:
    line = low_high(pt.triangle, 1.0, 3.0)
    parts = {"parts": ("pid", "low-pass"), "timing": pt.Timing(delay=2e-3)}
    return plays(30.0, 1.5, 200.0, 30e-9, line, **parts)


def notched() -> tuple[Any, Any, dict[str, Any]]:
    line = low_high(pt.sine, 10.0, 0.6)
    parts = {"parts": ("pid", "low-pass", "notch"), "timing": pt.Timing(delay=0.3e-3)}
    return plays(210.0, 0.02, 1000.0, 5e-9, line, **parts)


def with_inverse() -> tuple[Any, Any, dict[str, Any]]:
    line = low_high(pt.triangle, 5.0, 1.0)
    parts = {"parts": ("pid", "low-pass"), "timing": pt.Timing(delay=0.3e-3)}
    return plays(210.0, 0.05, 1000.0, 5e-9, line, inverse=True, **parts)


def fast() -> tuple[Any, Any, dict[str, Any]]:
    line = low_high(pt.sine, 20.0, 0.3)
    parts = {"parts": ("pid", "low-pass"), "timing": pt.Timing(delay=0.25e-3)}
    return plays(900.0, 0.02, 5000.0, 3e-9, line, inverse=True, **parts)


@cache
def calibrated() -> tuple[Apparatus, Any]:
    apparatus = Apparatus.calibrated().seeded(1000)
    return apparatus, search(record(apparatus), 1000).inverse()


def circle(radius: float, frequency: float) -> tuple[Any, Any, dict[str, Any]]:
    """A circle of Xu and Li 2010, Table 2, on the calibrated stage."""
    apparatus, inverse = calibrated()
    return (
        apparatus.stage,
        pt.circle(frequency=frequency, radius=radius),
        {
            "dt": 0.02,
            "limits": LIMITS,
            "feedforward": inverse,
            "timing": pt.Timing(delay=apparatus.delay),
            "parts": ("pid", "low-pass"),
            "goal": pt.Goal(largest_saturation=1.0),
            "spread": pt.Spread(**NO_OFFSET),
        },
    )


def repetitive() -> tuple[Any, Any, dict[str, Any]]:
    """A scan line on the stage of a measured log, the inverse of a model of another log."""
    tracking, training = pt.datasets.dbo_tracking(), pt.datasets.dbo_training()
    stage = pt.identify(tracking, "prandtl-ishlinskii")
    inverse = pt.identify(training, "prandtl-ishlinskii").inverse()
    middle = 0.5 * (tracking.y.min() + tracking.y.max())
    line = pt.triangle(frequency=2.0, low=middle - 10e-6, high=middle + 10e-6, duration=5.0)
    options = {
        "feedforward": inverse,
        "parts": ("pid", "low-pass", "repetitive"),
        "spread": pt.Spread(**NO_OFFSET),
    }
    noisy = pt.VirtualStage.of(stage, noise=5e-9, seed=1)
    return noisy, line, {"dt": stage.dt, "limits": stage.drive_range, **options}


def estimator() -> tuple[Any, Any, dict[str, Any]]:
    """Perturbation estimation around sliding mode along a triangle, without a model."""
    line = low_high(pt.triangle, 2.0, 1.5)
    parts = {"parts": ("pid", "low-pass"), "timing": pt.Timing(delay=0.5e-3)}
    return plays(160.0, 0.1, 500.0, 10e-9, line, law="perturbation-estimator", **parts)


def several() -> tuple[Any, Any, dict[str, Any]]:
    """A disturbance observer for three stages, along two motions."""
    stage, _, options = plays(300.0, 0.05, 1000.0, 5e-9, None, inverse=True)
    softer, stiffer = mode(PLAYS, 260.0, 0.03), mode(PLAYS, 330.0, 0.05)
    levels = [10e-6, 40e-6, 25e-6, 50e-6, 10e-6]
    motions = [pt.staircase(levels=levels, dwell=0.1), low_high(pt.sine, 10.0, 0.4)]
    options |= {
        "law": "disturbance-observer",
        "parts": ("pid", "low-pass"),
        "spread": pt.Spread(gain=0.1, delay=(0.0, 0.5e-3), **NO_OFFSET),
        "timing": pt.Timing(delay=0.3e-3),
    }
    return [stage, softer, stiffer], motions, options


CASES = (
    Case("lag, 200 Hz, no model", lag_like),
    Case("mode 210 Hz, notch, no model", notched),
    Case("mode 210 Hz, inverse", with_inverse),
    Case("mode 900 Hz, 5 kHz, inverse", fast),
    Case("XY circle 10 um, 0.5 Hz", partial(circle, 10e-6, 0.5)),
    Case("XY circle 40 um, 0.5 Hz", partial(circle, 40e-6, 0.5)),
    Case("XY circle 20 um, 0.2 Hz", partial(circle, 20e-6, 0.2)),
    Case("measured stage, repetitive", repetitive),
    Case("perturbation estimation", estimator),
    Case("three stages, disturbance observer", several),
)
