"""Controllers side by side on one stage."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

import piezotrack as pt

LIMITS = (0.0, 75.0)
QUICK: dict[str, Any] = {"search": pt.TuningSearch(particles=16, iterations=12), "searches": 1}


def plays(gain: float = 1.0) -> pt.stages.PrandtlIshlinskiiStage:
    return pt.stages.PrandtlIshlinskiiStage(
        linear=gain * 1e-6,
        thresholds=(5.0, 15.0),
        weights=(gain * 0.1e-6, gain * 0.1e-6),
        frequency=200.0,
        damping_ratio=0.1,
    )


def compared(**changes: Any) -> pt.control.ControllerComparison:
    # The model is 5 % off, so that feedback has something to do.
    given: dict[str, Any] = {
        "dt": 1e-3,
        "limits": LIMITS,
        "references": [pt.sine(frequency=5.0, low=20e-6, high=60e-6, duration=1.2)],
        **QUICK,
    }
    stage = pt.VirtualStage.of(plays(), noise=5e-9, seed=3)
    return pt.compare_controllers(stage, plays(1.05), **{**given, **changes})


def test_feedback_and_learning_beat_the_inverse_alone() -> None:
    found = compared(controllers=["inverse", "inverse + PID", "inverse + PID + repetitive"])
    inverse, pid, repetitive = (row.rms() for row in found.rows)
    assert inverse > 2.0 * pid
    assert inverse > 2.0 * repetitive
    # 5 % of a sine of 20 um, about its mean of 40 um: the inverse is off by that.
    assert inverse == pytest.approx(0.05 / 1.05 * math.hypot(40e-6, 20e-6 / math.sqrt(2)), rel=0.1)


def test_each_feedback_keeps_the_margins_and_each_step_is_timed() -> None:
    names = [
        "PID",
        "inverse + PD",
        "inverse + lead-lag",
        "inverse + integral-resonant",
        "inverse + positive-position",
        "inverse + positive-velocity-position",
        "inverse + sliding-mode",
        "inverse + perturbation-estimator",
        "inverse + disturbance-observer",
    ]
    found = compared(controllers=names, margins=pt.Margins(sensitivity=1.7))
    assert [row.name for row in found.rows] == names
    for row in found.rows:
        assert row.sensitivity is not None
        assert row.sensitivity <= 1.7 * 1.01
        assert 0.0 < row.step_time < 1e-4


def test_the_same_comparison_gives_the_same_file() -> None:
    first, second = (compared(controllers=["inverse", "PID"]).document() for _ in range(2))
    assert json.dumps(first) == json.dumps(second)
    assert first["schema_version"] == 1


def test_a_loop_with_more_gain_is_worse_and_one_beyond_its_margin_is_unstable() -> None:
    comparison = compared(controllers=["inverse", "inverse + PID"])
    assert comparison.variants[:2] == ("as tuned for", "1.3 times the gain")
    inverse = comparison.rows[0]
    # Without feedback, 30 % more gain are 30 % of 40 um off and more.
    assert inverse.rms(1) > 8e-6
    assert all(math.isfinite(row.rms(i)) for row in comparison.rows for i in range(5))


def test_what_cannot_follow_a_motion_has_no_figure_there() -> None:
    steps = pt.staircase(dwell=0.1, steps=4, low=20e-6, high=60e-6)
    sine = pt.sine(frequency=5.0, low=20e-6, high=60e-6, duration=1.2)
    comparison = compared(references=[sine, steps], controllers=["inverse + PID + repetitive"])
    assert comparison.rows[0].cells[0][0] is not None
    assert comparison.rows[0].cells[0][1] is None
    assert "-" in str(comparison)


def test_what_could_not_be_made_says_why() -> None:
    comparison = compared(controllers=["inverse", "network"])
    assert "record is missing" in comparison.refused["network"]
    assert "not made: network" in str(comparison)
    with pytest.raises(pt.ParameterError, match=r"not one could be made; network: record"):
        compared(controllers=["network"])
    once = pt.chirp(start_frequency=1.0, stop_frequency=5.0, low=20e-6, high=60e-6, duration=2.0)
    names = ["inverse", "inverse + PID + repetitive", "inverse + PID + learning"]
    comparison = compared(controllers=names, references=[once])
    assert [row.name for row in comparison.rows] == ["inverse"]
    for name in names[1:]:
        assert comparison.refused[name].startswith("references: expected one at least")
    assert max(map(len, str(comparison).splitlines())) <= 100


def noisy(seed: int) -> pt.VirtualStage:
    return pt.VirtualStage.of(plays(), noise=60e-9, seed=seed)


def test_each_is_judged_by_draws_of_the_noise_other_than_that_it_was_tuned_with() -> None:
    sine = pt.sine(frequency=5.0, low=20e-6, high=60e-6, duration=1.2)
    comparison = pt.compare_controllers(
        noisy(3), plays(1.05), dt=1e-3, limits=LIMITS, references=[sine], seeds=8,
        controllers=["inverse", "inverse + PID"], parts="pid", **QUICK,
    )  # fmt: skip
    inverse, pid = comparison.rows
    cell = pid.cells[0][0]
    assert cell is not None
    assert len(cell.draws) == len(set(cell.draws)) == 8
    # Runs of other draws belong to the same distribution, and that of the tuning is no draw of it.
    others = [pt.track(noisy(seed), pid.controller, sine) for seed in range(50, 62)]
    errors = np.array([(one.desired - one.displacement)[200:] for one in others])
    rms = np.sqrt(np.mean(errors**2, axis=1))
    assert cell.spread > 0.0
    assert abs(rms.mean() - cell.rms) < 4.0 * cell.spread / math.sqrt(8)
    assert 0.4 < rms.std(ddof=1) / cell.spread < 2.5
    assert cell.largest == pytest.approx(np.abs(errors).max(), rel=0.3)
    assert cell.largest > max(cell.draws)
    tuned = pt.track(noisy(3), pid.controller, sine)
    of_tuning = np.sqrt(np.mean((tuned.desired - tuned.displacement)[200:] ** 2))
    assert np.abs(np.array(cell.draws) / of_tuning - 1.0).min() > 1e-6
    # One reference: over all of them is along it. Without feedback noise does nothing.
    assert pid.rms() == pytest.approx(cell.rms)
    alone = inverse.cells[0][0]
    assert alone is not None
    assert alone.spread == pytest.approx(0.0, abs=1e-15)
    assert f"± {1e9 * cell.spread:.1g}" in str(comparison)


def test_chatter_is_the_fast_part_of_the_command_of_the_runs() -> None:
    sine = pt.sine(frequency=5.0, low=20e-6, high=60e-6, duration=1.2)
    # Above a quarter of the sampling rate.
    quick = pt.sine(frequency=260.0, low=39.8e-6, high=40.2e-6, duration=0.3)
    comparison = pt.compare_controllers(
        noisy(3), plays(1.05), dt=1e-3, limits=LIMITS, references=[sine, quick, sine],
        controllers=["inverse", "inverse + PID"], parts="pid", **QUICK,
    )  # fmt: skip
    inverse, pid = comparison.rows
    cell = pid.cells[0][0]
    assert cell is not None
    assert cell.chatter is not None
    run = pt.track(noisy(50), pid.controller, sine)
    chatter = pt.control.chatter(run, after=0.2)
    assert chatter.fast_change == pytest.approx(
        chatter.rms_change * math.sqrt(chatter.fast_share), rel=1e-12
    )
    assert cell.chatter == pytest.approx(chatter.fast_change, rel=0.15)
    assert cell.chatter < cell.effort
    # The noise of the sensor goes through the feedback; the inverse knows no sensor.
    assert inverse.chatter is not None
    assert pid.chatter is not None
    assert pid.chatter > 3.0 * inverse.chatter
    # A motion that asks for fast changes itself does not decide.
    fast = inverse.cells[0][1]
    assert fast is not None
    assert fast.chatter is not None
    assert fast.chatter > 20.0 * inverse.chatter
    # It is that of the stage that it was tuned for.
    assert all(one is None or one.chatter is None for one in pid.cells[1])


def test_the_settling_time_is_that_of_the_moves() -> None:
    stairs = pt.staircase(steps=3, low=20e-6, high=60e-6, dwell=0.3, rise=0.02)
    sine = pt.sine(frequency=5.0, low=20e-6, high=60e-6, duration=1.2)
    comparison = pt.compare_controllers(
        noisy(3), plays(1.05), dt=1e-3, limits=LIMITS, references=[sine, stairs],
        controllers=["inverse + PID"], parts="pid", **QUICK,
    )  # fmt: skip
    (row,) = comparison.rows
    assert row.settled is not None
    moves = pt.track(noisy(50), row.controller, stairs).settling(0.02)
    times = [move.time for move in moves]
    assert row.settled == pytest.approx(np.median(times), abs=2e-3)
    assert row.cells[0][0] is not None
    assert row.cells[0][0].settled is None


def test_one_draw_has_no_spread() -> None:
    comparison = compared(controllers=["inverse + PID"], seeds=1)
    cell = comparison.rows[0].cells[0][0]
    assert cell is not None
    assert math.isnan(cell.spread)
    assert "±" not in str(comparison)
    assert "one draw of the noise" in str(comparison)
    figures = comparison.document()["controllers"][0]["figures"][0][0]
    assert figures["spread"] is None
    assert figures["draws"] == [figures["rms"]]


def test_the_tables_fit_a_terminal_and_a_notebook() -> None:
    names = ["inverse", "inverse + perturbation-estimator"]
    comparison = compared(controllers=names, references=None, rates=(2.0, 5.0, 20.0))
    lines = str(comparison).splitlines()
    assert max(map(len, lines)) <= 100
    assert lines[0].startswith("true error in nm rms at 1000 Hz, mean of 3 draws of the noise")
    # Each table has each of them.
    assert sum(line.startswith("inverse + perturbation") for line in lines) == 4
    html = comparison._repr_html_()
    assert html.count("<table>") == html.count("</table>") == 4
    assert "<th>inverse + perturbation-estimator</th>" in html


def test_the_document_is_json() -> None:
    text = json.dumps(compared(controllers=["inverse"]).document(), allow_nan=False)
    document = json.loads(text)
    assert document["controllers"][0]["name"] == "inverse"
    assert document["seeds"] == 3
    figures = document["controllers"][0]["figures"][0][0]
    assert len(figures["draws"]) == 3
    assert {"rms", "spread", "largest", "effort", "clipped", "chatter"} < figures.keys()


def test_the_picture_has_a_mark_for_each_reference() -> None:
    figure = compared(controllers=["inverse", "inverse + PID"]).plot()
    left, right = figure.axes
    assert len(left.lines) == 1
    assert len(right.lines) == 5


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"controllers": ["pid"]}, r"controllers\[0\] is 'pid'"),
        ({"references": []}, "references is empty"),
        ({"controllers": []}, "controllers is empty"),
        ({"references": ["sine"]}, "references has str"),
        ({"limits": (1.0, 0.0)}, "expected the lower one first"),
        ({"dt": 0.0}, "dt is 0"),
        ({"timing": pt.Timing(delay=-1.0)}, "delay is -1"),
        ({"timing": 1e-3}, "timing is float: expected pt.Timing"),
        ({"references": None, "rates": (1.0, 2.0)}, "rates is .* in rising order"),
        ({"references": None, "rates": (1.0, 2.0, 500.0)}, "rates ends with 500 Hz"),
        ({"references": None, "rates": (1e-9, 2.0, 5.0)}, "rates begins with 1e-09 Hz"),
        ({"seeds": 0}, "seeds is 0: expected 1 to 100"),
        ({"seeds": 101}, "seeds is 101: expected 1 to 100"),
    ],
)
def test_wrong_arguments_are_named(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(pt.ParameterError, match=words):
        compared(**changes)


def test_errors_are_relative_to_the_inverse_alone_and_no_motion_decides_alone() -> None:
    """Two motions, one of which leaves ten times the error of the other."""
    references = [
        pt.sine(frequency=2.0, low=20e-6, high=60e-6, duration=3.0),
        pt.sine(frequency=5.0, low=5e-6, high=8e-6, duration=1.2),
    ]
    found = compared(references=references, controllers=["inverse", "inverse + PID"], searches=2)
    inverse, pid = found.rows
    assert inverse.relative() == pytest.approx(1.0)
    large, small = (cell.rms / cell.alone for cell in pid.cells[0] if cell is not None)
    assert pid.relative() == pytest.approx(math.sqrt(0.5 * (large**2 + small**2)))
    assert len(pid.searches) == 2
    assert pid.searches[0] == pytest.approx(pid.relative())
    assert pid.searches[0] <= pid.searches[1]
    assert list(inverse.searches) == pytest.approx([1.0])
    assert found.document()["controllers"][1]["relative_error"][0] == pid.relative()
    # Tuned by the rms over both, the smaller motion has less of a say.
    by_rms = pt.tune(
        pt.VirtualStage.of(plays(), noise=5e-9, seed=3),
        references,
        dt=1e-3,
        limits=LIMITS,
        feedforward=plays(1.05).inverse(),
        goal=pt.Goal(error="true", tolerances=[1e-6, 1e-6]),
        **{"search": QUICK["search"]},
    )
    assert by_rms.value > 0.0
    for wrong, words in (([1e-6], "1: expected 2"), ([0.0, 1e-6], "tolerances")):
        with pytest.raises(pt.ParameterError, match=words):
            pt.tune(
                plays(),
                references,
                dt=1e-3,
                limits=LIMITS,
                goal=pt.Goal(tolerances=wrong),
                **{"search": QUICK["search"]},
            )


@pytest.mark.slow
def test_a_law_is_not_worse_than_the_law_that_it_contains() -> None:
    stage = pt.VirtualStage.of(plays(), noise=5e-9, seed=3)
    containing = {
        "inverse + PID + notch": "inverse + PID",
        "inverse + disturbance-observer": "inverse + PID",
        "inverse + perturbation-estimator": "inverse + sliding-mode",
    }
    names = sorted({*containing, *containing.values()})
    found = pt.compare_controllers(
        stage, plays(1.05), dt=1e-3, limits=LIMITS, controllers=names, searches=1, seeds=1
    )
    error = {row.name: row.relative() for row in found.rows}
    for law, contained in containing.items():
        assert error[law] <= 1.03 * error[contained]
