"""Exports under inputs that no loop has: every branch of the C gives the bits of Rust."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from c_exports import DAHL, PARTS, PI, checked, compiled, needs_gcc
from piezotrack.export.vectors import Row, vectors_text

if TYPE_CHECKING:
    from pathlib import Path

LIMITS = (5.0, 70.0)
SPAN = (-2e-4, 3e-4)


def learning(**given: Any) -> dict[str, Any]:
    return {"feedback": PI, "repetitive": pt.Repetitive.from_um(**given)}


# More ways through the repetitive part: short periods, in part of a sample, read early.
STRESSED = PARTS | {
    "compensated": learning(period=0.4, kq=1.2, smoothing=pt.control.Lag(tq=0.1, compensated=True)),
    "longer than whole": learning(period=0.308, kq=0.9, smoothing=pt.control.ZeroPhase(order=1)),
    "shorter than whole": learning(period=0.312, kq=0.9, smoothing=pt.control.ZeroPhase(order=4)),
    "learning alone": {
        "repetitive": pt.Repetitive.from_um(
            period=0.4, kq=1.9, smoothing=None, forgetting_factor=1.0
        )
    },
    "parabola": {"feedforward": replace(DAHL, a1=0.0, a2=0.0).inverse(), "feedback": PI},
}


def hostile(controller: pt.Controller, seed: int, steps: int = 3000) -> list[Row]:
    """Blocks of a motion, of jumps, of saturation at either limit, with reports and resets."""
    rng = np.random.default_rng(seed)
    session, rows, x = controller.start(), [], 5e-5
    online = controller.feedforward is not None
    low, high = LIMITS
    shift = level = swing = 0.0
    for k in range(steps):
        if k % 120 == 0:
            level = float(rng.choice([5e-5, 5e-5, 0.0, 1e-4, -1.9e-4, 2.9e-4]))
            swing = float(rng.choice([0.0, 1e-5, 4e-5]))
            # The stage creeps away: what was learnt is then too much.
            shift = float(rng.choice([0.0, 0.0, 5e-5, -5e-5]))
        desired = level + swing * math.sin(2.0 * math.pi * k / 20.0)
        desired = float(np.clip(desired, *SPAN)) if rng.random() > 0.01 else math.nan
        ahead = desired + 1e-6 * float(rng.standard_normal()) if rng.random() > 0.3 else math.nan
        ahead = float(np.clip(ahead, *SPAN))
        measured = x + 1e-8 * float(rng.standard_normal())
        if rng.random() < 0.02:
            measured = float(rng.choice([math.nan, math.inf, 9.9e37, 2.5e-4, -1.5e-4, 1e-300]))
        given = float(rng.choice([0.0, 10.0, 30.0]))
        if rng.random() < 0.02:
            given = float(rng.choice([-300.0, 600.0, math.nan, -math.inf, -0.0]))
        reset = bool(rng.random() < 0.0005)
        if reset:
            session.reset()
        preview = ahead if online and not math.isnan(ahead) else None
        out = session.step(
            desired, measured, preview=preview, feedforward=None if online else given
        )
        last = session.last
        applied = math.nan
        if rng.random() < 0.02:
            applied = float(rng.choice([low, high, out, out + 0.1, 0.5 * out, -500.0, 1e37]))
            session.applied(applied)
        x += 0.4 * (1.5e-6 * out + shift - x)
        flags = (last.saturated, last.measurement_valid, last.reference_valid)
        parts = (last.unclipped, last.feedback, last.repetitive, last.error)
        rows.append(Row(desired, ahead, measured, given, reset, applied, out, *parts, *flags))
    return rows


# The inverse is found again by bisection in many of their steps.
BISECTED = ("Dahl", "Dahl with dry friction", "all")


@needs_gcc
@pytest.mark.parametrize(
    "name",
    [pytest.param(one, marks=[pytest.mark.slow] * (one in BISECTED)) for one in STRESSED],
)
def test_hostile_inputs_give_the_bits_of_rust(name: str, tmp_path: Path) -> None:
    parts = {**STRESSED[name], "span": SPAN}
    controller = pt.Controller(dt=0.02, limits=LIMITS, **parts)
    pt.control.export_controller(controller, tmp_path, name="axis")
    compiled(tmp_path, "check.c", "axis.c")
    for seed in (1, 2):
        rows = hostile(controller, seed)
        assert sum(row.saturated for row in rows) > 250
        (tmp_path / "vectors.csv").write_text(vectors_text(rows, "V"))
        code, figures = checked(tmp_path)
        assert (code, figures["largest"], figures["flags"]) == (0, 0.0, 0.0)
        assert figures["steps"] == 3000
