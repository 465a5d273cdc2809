"""Controllers in C of floats: how far they are from those of doubles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import piezotrack as pt
from c_exports import PARTS, STRICT, checked, compiled, loop, needs_gcc

if TYPE_CHECKING:
    from pathlib import Path

export = pt.control.export_controller


@pytest.mark.slow
@needs_gcc
@pytest.mark.parametrize("name", PARTS)
def test_floats_stay_within_the_bound_that_is_stated(name: str, tmp_path: Path) -> None:
    done = export(loop(name), tmp_path, name="axis", single=True)
    compiled(tmp_path, "check.c", "axis.c", flags=(*STRICT, "-Wdouble-promotion"))
    code, figures = checked(tmp_path)
    assert code == 0
    assert done.bound is not None
    assert 0.0 < figures["largest"] <= done.bound
    # 1.5 mV of 75 V; an observer around an integral adds up twice where no reading answers.
    observes = name in ("disturbance observer", "hysteresis observer", "perturbation")
    online = "next" in (tmp_path / "axis.h").read_text().partition("axis_step(")[2]
    expected = 7.5 if observes else 1.5e-3
    # Differences of a reference that is rounded come in addition.
    assert expected * (1 - 1e-9) <= done.bound <= expected + (0.02 if online else 1e-9)
    assert observes or figures["largest"] < 0.2 * done.bound
    assert figures["state"] == done.state_bytes


@needs_gcc
@pytest.mark.parametrize("dt", [1e-3, 1e-4, 2e-5])
def test_floats_of_the_online_inverse_stay_within_their_bound_at_any_rate(
    dt: float, tmp_path: Path
) -> None:
    """A rounded reference counts the more in its differences the shorter the interval."""
    controller = pt.Controller(
        dt=dt,
        limits=(10.0, 40.0),
        feedback=pt.control.LeadLag(kp=1e5, lead=0.01, lag=0.1),
        feedforward=pt.DahlStage.xu_li_2010().inverse(),
    )
    done = export(controller, tmp_path, name="axis", single=True)
    compiled(tmp_path, "check.c", "axis.c")
    code, figures = checked(tmp_path)
    assert code == 0
    assert done.bound is not None
    assert 0.1 * done.bound < figures["largest"] < done.bound


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
