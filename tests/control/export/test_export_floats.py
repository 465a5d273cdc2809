"""Controllers in C of floats: how far they are from those of doubles."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

import piezotrack as pt
from c_exports import (
    DAHL,
    PARTS,
    PI,
    SLIDING,
    STRICT,
    checked,
    compiled,
    learner,
    loop,
    needs_gcc,
)

if TYPE_CHECKING:
    from pathlib import Path

export = pt.control.export_controller


@pytest.mark.slow
@needs_gcc
@pytest.mark.parametrize("name", PARTS)
def test_floats_stay_within_the_bound_that_is_stated(name: str, tmp_path: Path) -> None:
    done = export(loop(name), tmp_path, name="axis", single=True)
    compiled(tmp_path, "check.c", "axis.c", flags=STRICT)
    code, figures = checked(tmp_path)
    assert code == 0
    assert done.bound is not None
    assert 0.0 < figures["largest"] <= done.bound
    # 1.5 mV of 75 V; differences of a reference or a reading that is rounded come in addition.
    assert 1.5e-3 * (1 - 1e-9) <= done.bound <= 1.5e-3 + 3e-4
    assert figures["largest"] < 0.2 * done.bound
    assert figures["state"] == done.state_bytes


def inverse(**given: Any) -> pt.Inverse:
    friction = given.pop("b0", None)
    stage = DAHL if friction is None else replace(DAHL, b0=friction)
    return pt.Inverse(stage=stage, **given)


LEADS = pt.control.LeadLag(kp=1e5, lead=0.01, lag=0.1)
# Interval, limits, feedback and inverse, or repetitive part. Short intervals, where differences of
# a rounded reference count most, limits that clip, delays that are compensated, dry friction.
ONLINE: dict[str, tuple[float, tuple[float, float], Any, pt.Inverse]] = {
    "50 Hz": (0.02, (10.0, 40.0), LEADS, inverse()),
    "1 kHz": (1e-3, (10.0, 40.0), LEADS, inverse()),
    "10 kHz": (1e-4, (10.0, 40.0), LEADS, inverse()),
    "50 kHz": (2e-5, (10.0, 40.0), LEADS, inverse()),
    "wide, 10 kHz": (1e-4, (0.0, 75.0), LEADS, inverse()),
    "narrow, 10 kHz": (1e-4, (30.0, 33.0), LEADS, inverse()),
    "delay, 50 Hz": (0.02, (10.0, 40.0), LEADS, inverse(offset=1e-6, delay=0.03)),
    "delay, 1 kHz": (1e-3, (10.0, 40.0), LEADS, inverse(offset=1e-6, delay=0.03)),
    "delay, 10 kHz": (1e-4, (10.0, 40.0), LEADS, inverse(offset=1e-6, delay=0.003)),
    "friction, 1 kHz": (1e-3, (10.0, 40.0), LEADS, inverse(b0=40.0)),
    "friction, delay": (1e-3, (10.0, 40.0), LEADS, inverse(b0=40.0, delay=0.003)),
    "PI, 200 Hz": (5e-3, (10.0, 40.0), PI, inverse()),
    "alone, 100 Hz": (1e-2, (5.0, 70.0), None, inverse()),
}


@needs_gcc
@pytest.mark.parametrize("name", ONLINE)
def test_floats_of_the_online_inverse_stay_within_their_bound(name: str, tmp_path: Path) -> None:
    """A rounded reference counts the more in its differences the shorter the interval."""
    dt, limits, law, forward = ONLINE[name]
    controller = pt.Controller(dt=dt, limits=limits, feedback=law, feedforward=forward)
    figures, bound = figures_of(controller, tmp_path)
    assert figures["flags"] <= 20
    # Not so wide that it would let a wrong step pass.
    share = 0.1 if dt <= 1e-3 else 0.01
    assert share * bound < figures["largest"] < bound


def figures_of(controller: pt.Controller, folder: Path) -> tuple[dict[str, float], float]:
    """Figures that the check of a float prints, and the bound that it holds them to."""
    done = export(controller, folder, name="axis", single=True)
    compiled(folder, "axis.c", flags=(*STRICT, "-c"))
    compiled(folder, "check.c", "axis.c")
    code, figures = checked(folder)
    assert code == 0
    assert done.bound is not None
    return figures, done.bound


def disturbance(**given: Any) -> pt.control.DisturbanceObserver:
    known: dict[str, Any] = {"pid": PI, "plant_gain": 1.5e-6, "cutoff": 1.0, "plant_time": 0.05}
    return pt.control.DisturbanceObserver(**(known | given))


HYSTERESIS = pt.control.HysteresisObserver(stage=DAHL, pid=PI)
LEARNS = {"repetitive": learner(period=0.5, kq=0.3, tq=0.005)}
OBSERVERS: dict[str, dict[str, Any]] = {
    "disturbance, 50 Hz": {"dt": 0.02, "feedback": disturbance(cutoff=3.0)},
    "disturbance, 1 kHz": {"dt": 1e-3, "feedback": disturbance(cutoff=10.0)},
    "disturbance, 10 kHz": {"dt": 1e-4, "feedback": disturbance(cutoff=100.0)},
    "disturbance, PID": {"dt": 0.02, "feedback": disturbance(pid=pt.Pid.xu_li_2010())},
    "disturbance, downwards": {
        "dt": 0.02,
        "feedback": disturbance(plant_gain=-1.5e-6, pid=replace(PI, kp=-PI.kp)),
    },
    "hysteresis, 50 Hz": {"dt": 0.02, "feedback": replace(HYSTERESIS, correction=0.3)},
    "hysteresis, 1 kHz": {"dt": 1e-3, "feedback": HYSTERESIS},
    "hysteresis, 10 kHz": {"dt": 1e-4, "feedback": HYSTERESIS},
    "hysteresis, narrow": {"dt": 0.02, "feedback": HYSTERESIS, "limits": (10.0, 40.0)},
    "hysteresis, learning": {"dt": 1e-3, "feedback": HYSTERESIS, **LEARNS},
    "hysteresis, inverse": {"dt": 0.02, "feedback": HYSTERESIS, "feedforward": inverse()},
    "perturbation, 1 kHz": {
        "dt": 1e-3,
        "feedback": pt.control.PerturbationEstimator(
            sliding=SLIDING, plant_gain=1.5e-6, cutoff=10.0
        ),
    },
}


@needs_gcc
@pytest.mark.parametrize("name", OBSERVERS)
def test_floats_of_an_observer_stay_within_their_bound_in_a_closed_loop(
    name: str, tmp_path: Path
) -> None:
    controller = pt.Controller(**({"limits": (0.0, 75.0)} | OBSERVERS[name]))
    figures, bound = figures_of(controller, tmp_path)
    assert 0.0 < figures["largest"] < 0.6 * bound
    low, high = controller.limits
    # A hundredth of a percent of the range, where a replay was off by volts.
    assert bound <= 1e-4 * (high - low)
    assert figures["flags"] <= 20


@needs_gcc
def test_a_wrong_observer_is_found_in_a_closed_loop(tmp_path: Path) -> None:
    """A thousandth more of the estimate is more than the bound."""
    done = export(loop("hysteresis observer"), tmp_path, name="axis", single=True)
    source = (tmp_path / "axis.c").read_text()
    wrong = "volts = pid_step(s, in) + (real)1.001 * s->hysteresis_force;"
    changed = source.replace("volts = pid_step(s, in) + s->hysteresis_force;", wrong)
    assert changed != source
    (tmp_path / "axis.c").write_text(changed)
    compiled(tmp_path, "check.c", "axis.c")
    code, figures = checked(tmp_path)
    assert code == 1
    assert done.bound is not None
    assert figures["largest"] > done.bound


CLOSED = """
#include <stdio.h>
#include "axis.h"
#include "single.h"
/* Both around the same lag of 1.5 um/V, along a triangle of 10 to 60 um. */
int main(void)
{
    static axis_state s;
    static single_state f;
    double x = 0, y = 0, largest = 0;
    long k;
    axis_init(&s);
    single_init(&f);
    for (k = 0; k < 20000; k++) {
        const double turn = (double)(k % 500) / 250.0;
        const double r = 10e-6 + 50e-6 * (turn < 1.0 ? turn : 2.0 - turn);
        const double one = axis_step(&s, r, x, 0.0);
        const double other = (double)single_step(&f, (float)r, (float)y, 0.0f);
        const double d = one > other ? one - other : other - one;
        x += 0.3 * (1.5e-6 * one - x);
        y += 0.3 * (1.5e-6 * other - y);
        largest = d > largest ? d : largest;
    }
    printf("largest %.3g\\n", largest);
    return 0;
}
"""


@needs_gcc
@pytest.mark.parametrize(
    "name", [one for one in PARTS if "observer" in one or one in ("perturbation", "repetitive")]
)
def test_in_a_closed_loop_floats_add_up_nothing(name: str, tmp_path: Path) -> None:
    """20 000 steps: ten times as many as the vectors, and no more than the bound of 2000."""
    for which, single in (("axis", False), ("single", True)):
        export(loop(name), tmp_path, name=which, single=single)
    (tmp_path / "closed.c").write_text(CLOSED)
    compiled(tmp_path, "closed.c", "axis.c", "single.c")
    code, figures = checked(tmp_path)
    assert code == 0
    assert figures["largest"] < 1.5e-3
