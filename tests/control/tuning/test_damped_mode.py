"""Laws that damp a mode against a PI law with the same margins: the example of the page."""

from __future__ import annotations

import runpy
from typing import Any

import pytest

import piezotrack as pt
from folders import ROOT

NAMES = ("integral-resonant", "positive-position", "positive-velocity-position")


@pytest.fixture(scope="module")
def example() -> dict[str, Any]:
    return runpy.run_path(str(ROOT / "python" / "examples" / "damp_a_mode.py"))


@pytest.fixture(scope="module")
def plain(example: dict[str, Any]) -> Any:
    return example["judged"](example["tuned"]("pi"))


@pytest.mark.slow
@pytest.mark.parametrize("law", NAMES)
def test_a_damped_mode_gives_five_times_the_speed_of_a_pi_law(
    law: str, example: dict[str, Any], plain: Any
) -> None:
    damped = example["judged"](example["tuned"](law))
    assert damped.bandwidth > 5.0 * plain.bandwidth
    assert damped.settling < plain.settling / 5.0
    assert damped.error < plain.error / 5.0


@pytest.mark.slow
@pytest.mark.parametrize("law", NAMES)
def test_the_margins_that_were_asked_for_are_kept_with_the_mode_off_by_a_tenth(
    law: str, example: dict[str, Any]
) -> None:
    controller = pt.tune(
        example["stage"](),
        dt=example["DT"],
        limits=example["LIMITS"],
        law=law,  # type: ignore[arg-type]
        parts="pid",
        timing=example["LATE"],
        spread=pt.Spread(mode=0.1),
    ).controller
    for share in (0.9, 1.0, 1.1):
        other = example["stage"](share * example["MODE"])
        loop = pt.check_loop(other, controller, delay=example["LATE"].delay).middle
        assert loop.stable
        assert loop.sensitivity < 2.01
        assert loop.phase_margin is not None
        assert loop.phase_margin > 0.497


@pytest.mark.parametrize("law", NAMES)
def test_gains_from_margins_alone_damp_the_mode(law: str, example: dict[str, Any]) -> None:
    quick = pt.TuningSearch(particles=16, iterations=10)
    controller = pt.tune(
        example["stage"](),
        dt=example["DT"],
        limits=example["LIMITS"],
        law=law,  # type: ignore[arg-type]
        parts="pid",
        timing=example["LATE"],
        search=quick,
    ).controller
    step = pt.staircase(dwell=0.3, steps=1, low=20e-6, high=30e-6, rise=example["DT"])
    run = pt.track(example["stage"](), controller, step, timing=example["LATE"])
    # What the mode by itself takes is 0.2 s.
    assert run.settling()[0].time < 0.06
