"""``piezotrack track`` with a model of several axes: references of each, before and after."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import piezotrack as pt
from commands import ran, refusal

GAINS = ["--kp", "0.01", "--ti", "1ms"]
CIRCLE = "circle:0.5Hz,10um,1s"


@cache
def document() -> str:
    stage = pt.multiaxis.VirtualAxes.xu_li_2010(seed=1)
    return json.dumps(pt.multiaxis.identify_axes(stage.record(samples=512)).document())


@pytest.fixture(autouse=True)
def _in_a_folder_with_models(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, _no_pictures: None
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("axes.json").write_text(document())
    dahl = pt.DahlStage.xu_li_2010()
    pt.identification.IdentifiedModel(
        model=dahl, offset=0.0, offset_fitted=False, stroke=119e-6
    ).save("dahl.json")
    time = 1e-3 * np.arange(200)
    rise = np.clip((time - 0.05) / 0.1, 0.0, 1.0)
    for name, axes in (("two", 2), ("three", 3)):
        titles = ",".join(f"{axis}_um" for axis in "xyz"[:axes])
        columns = [rise, 0.5 * rise, 0.0 * rise][:axes]
        np.savetxt(
            f"{name}.csv", np.column_stack([time, *columns]), delimiter=",", comments="",
            header=f"time_s,{titles}",
        )  # fmt: skip


def test_cross_coupling_is_less_after_the_decoupling() -> None:
    words = ran("track", "axes.json", CIRCLE, *GAINS, "-o", "run")
    assert "before, each axis by its own gain" in words
    found = json.loads(Path("run", "axes_run.json").read_text())
    assert found["stable"]
    assert found["sensitivity"] < 1.3
    before, after = found["diagonal"]["cross_coupling"], found["cross_coupling"]
    assert max(after) < 0.5 * max(before)
    assert len(Path("run", "axes_run.csv").read_text().splitlines()) == 1001


def test_a_file_has_a_column_of_each_axis_and_a_run_is_followed_again() -> None:
    ran("track", "axes.json", "two.csv", *GAINS, "-o", "run")
    table = np.genfromtxt("run/axes_run.csv", delimiter=",", names=True)
    assert table["reference_0_um"][-1] == pytest.approx(1.0)
    assert table["reference_1_um"][-1] == pytest.approx(0.5)
    # Of its columns those called reference are followed.
    ran("track", "axes.json", "run/axes_run.csv", *GAINS, "-o", "again")
    again = np.genfromtxt("again/axes_run.csv", delimiter=",", names=True)
    assert again["reference_1_um"] == pytest.approx(table["reference_1_um"], abs=1e-9)


def test_an_axis_without_a_motion_stays() -> None:
    ran("track", "axes.json", ";s-curve:0..1um,dwell=50ms,rise=20ms", *GAINS, "-o", "run")
    table = np.genfromtxt("run/axes_run.csv", delimiter=",", names=True)
    assert not table["reference_0_um"].any()
    assert table["displacement_1_um"].max() == pytest.approx(1.0, abs=0.05)
    assert np.abs(table["displacement_0_um"]).max() < 0.01


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["three.csv", *GAINS], "three.csv: reference has 3 axes: expected 2"),
        (["sine:5Hz,0..1um", *GAINS], "reference has 1 axis: expected 2"),
        (["sine:5Hz,0..1um;sine:4Hz,0..1um", *GAINS], "reference has 0.8 s of axis 0"),
        ([";", *GAINS], "reference is '': expected a file or one of"),
        (["sine:5Hz,0..1um;sine:5Hz", *GAINS], "there is no range"),
        ([CIRCLE], "--kp is missing: expected --kp 0.01um/um --ti 1ms"),
        ([CIRCLE, "--kp", "0.1"], "--ti is missing"),
        ([CIRCLE, "--kp", "0.01V/um", "--ti", "1ms"], "--kp is in V/um: expected a ratio"),
        ([CIRCLE, "--kp", "0.5", "--ti", "1ms"], "the decoupled loop is unstable"),
        ([CIRCLE, *GAINS, "--delay", "1ms"], "--delay has no effect with several axes"),
        ([CIRCLE, *GAINS, "--repetitive"], "--repetitive has no effect with several axes"),
        ([CIRCLE, *GAINS, "--device", "virtual:"], "--device has no effect with several axes"),
        ([CIRCLE, *GAINS, "--seed", "2"], "--seed has no effect without --noise"),
        ([CIRCLE, *GAINS, "--stage", "dahl.json"], "--stage is dahl.json: expected a model of"),
        ([CIRCLE, *GAINS, "--stage", "xu-li-2010"], "expected a model of several axes"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_sentence(arguments: list[str], words: str) -> None:
    assert words in refusal("track", "axes.json", *arguments)


def test_an_unstable_loop_runs_where_that_is_asked_for() -> None:
    arguments = ["s-curve:0..1um,dwell=10ms,rise=10ms;", "--kp", "0.2", "--ti", "1ms"]
    ran("track", "axes.json", *arguments, "--unstable", "-o", "run")
    assert not json.loads(Path("run", "axes_run.json").read_text())["stable"]


def test_a_model_of_one_axis_has_one_reference() -> None:
    words = refusal("track", "dahl.json", "sine:1Hz,0..9um;sine:1Hz,0..9um", "--dt", "1ms")
    assert "REFERENCE is of 2 axes: expected one reference, as the model has one axis" in words


@pytest.mark.parametrize(
    "arguments",
    [
        ["simulate", "axes.json", "two.csv"],
        ["feedforward", "axes.json", "sine:1Hz,0..9um"],
        ["tune", "axes.json", "sine:1Hz,0..9um"],
        ["learn", "axes.json", "sine:1Hz,0..9um"],
        ["contour", "axes.json", CIRCLE],
        ["export", "axes.json"],
        [
            "verify",
            "axes.json",
            "random-phase:1..400Hz,-1..1V",
            "--level",
            "1um",
            "--device",
            "virtual:",
        ],
        ["watch", "axes.json", "two.csv"],
        [
            "suggest",
            "axes.json",
            "--limits",
            "0:75V",
            "--slew",
            "2000V/s",
            "--duration",
            "4s",
            "--dt",
            "1ms",
        ],
        ["compare-controllers", "axes.json"],
    ],
)
def test_commands_of_one_axis_say_that_a_model_has_several(arguments: list[str]) -> None:
    words = refusal(*arguments)
    assert "axes.json is a model of several axes, which only `track` takes: expected a" in words
