"""`piezotrack contour` and `piezotrack noise`: what they write, and what they refuse."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import piezotrack as pt
from commands import ran, refusal, table
from loops import PID, fitted, loop, model_text

STAGE = pt.XYStage.xu_li_2010(seed=1)
PAPER = ("--stage", "xu-li-2010")


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("dahl.json").write_text(model_text(), encoding="utf-8")


def test_contour_writes_what_python_finds() -> None:
    printed = ran("contour", "dahl.json", "circle:0.5Hz,10um", *PAPER)
    written = sorted(path.name for path in Path("results").iterdir())
    assert written == ["contour.csv", "contour.json", "contour.png", "contour.svg"]
    one = loop(feedforward=fitted().inverse(), feedback=PID)
    expected = pt.contour(STAGE, (one, one), pt.circle(frequency=0.5, radius=10e-6))
    assert expected.summary() in printed
    assert printed.startswith(
        "stage: the virtual XY stage of Xu and Li 2010: y lags by 0.01 s, 1.5 %"
    )
    rows = table("results/contour.csv")
    assert np.allclose(rows["measured_y_um"], 1e6 * expected.y.measured, rtol=1e-9, atol=1e-9)
    radial = 10.0 - np.hypot(rows["measured_x_um"] - 58.5, rows["measured_y_um"] - 58.5)
    assert np.allclose(rows["contour_error_um"], radial, atol=1e-8)
    document = json.loads(Path("results/contour.json").read_text(encoding="utf-8"))
    assert document["format"] == "piezotrack-contour"
    assert document["contour"]["sd_error"] == expected.metrics.sd_error
    assert document["y"]["max_error"] == expected.y.metrics.max_error


@pytest.mark.usefixtures("_no_pictures")
def test_two_models_are_the_two_axes() -> None:
    """In the middle of their workspace, from where they rest, with the interval of the record."""
    other = replace(pt.load("dahl.json"), offset=5e-6)
    other.save("other.json")
    course = ("circle:1Hz,10um,4s", "--dt", "0.002", "--cross-talk", "0.05:0.02")
    printed = ran("contour", "dahl.json", "other.json", *course)
    assert printed.startswith("stage: dahl.json and other.json: y lags by 0 s, 5 % of y in x")
    fits = [pt.load("dahl.json"), other]
    stage = pt.XYStage(x=fits[0], y=fits[1], cross_talk=(0.05, 0.02))
    limits = [fit.drive_range for fit in fits]
    found = pt.control.workspace(stage, [one for one in limits if one is not None])
    middle = 1e6 * np.array(found.centre)
    assert middle[1] - middle[0] == pytest.approx(5.0 - 1e6 * fits[0].offset, abs=0.1)
    rows = table("results/contour.csv")
    late = rows["time_s"] > 1.999
    for axis, at in zip("xy", middle, strict=True):
        assert rows[f"desired_{axis}_um"][late].mean() == pytest.approx(at, abs=0.01)
    mixed = np.ptp(rows["contour_error_um"][late])
    # Decoupled about the offsets, the circle is one again, but for the hold.
    ran("contour", "dahl.json", "other.json", *course, "--decouple", "--overwrite")
    rows = table("results/contour.csv")
    assert np.ptp(rows["contour_error_um"][late]) < 0.05 * mixed
    assert abs(rows["contour_error_um"][late].mean()) < 0.05


@pytest.mark.usefixtures("_no_pictures")
def test_other_models_are_the_stage_of_both_axes() -> None:
    known = pt.load("dahl.json")
    for name, factor in (("x", 1.1), ("y", 0.9)):
        stage = replace(known.model, piezo_coefficient=factor * known.model.piezo_coefficient)
        replace(known, model=stage).save(f"{name}.json")
    course = ("circle:1Hz,10um,4s", "--dt", "0.002", "--stage", "x.json")
    printed = ran("contour", "dahl.json", *course, "--stage", "y.json")
    assert printed.startswith("stage: x.json and y.json: ")
    rows = table("results/contour.csv")
    late = rows["time_s"] > 1.999
    for axis, factor in (("x", 1.1), ("y", 0.9)):
        # The inverse of the model, on a stage of another gain.
        moved = np.ptp(rows[f"measured_{axis}_um"][late])
        assert moved == pytest.approx(factor * 20.0, rel=0.05)
    ran("contour", "dahl.json", *course, "--overwrite")
    rows = table("results/contour.csv")
    both = [np.ptp(rows[f"measured_{axis}_um"][rows["time_s"] > 1.999]) for axis in "xy"]
    assert both[0] == pytest.approx(both[1], rel=1e-3)


@pytest.mark.usefixtures("_no_pictures")
def test_each_axis_may_have_its_own_gain() -> None:
    """One falls as the voltage rises: no gain is right for both."""
    stage = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(), weights=(), time_constant=5e-3)
    for name, linear in (("x.json", 1e-6), ("y.json", -0.2e-6)):
        pt.identification.IdentifiedModel(
            model=replace(stage, linear=linear), offset=0.0, offset_fitted=True, stroke=50e-6
        ).save(name)
    for name, kp in (("x", 0.05), ("y", -0.25)):
        pt.Controller(
            dt=0.005,
            limits=(0.0, 75.0),
            feedforward=pt.load(f"{name}.json").inverse(),
            feedback=pt.Pid.from_um(kp=kp, ti=0.02),
        ).save(f"loop_{name}.json")
    course = "circle:0.5Hz,2um"
    printed = ran("contour", "loop_x.json", "loop_y.json", course)
    assert "contour error" in printed
    assert "controllers of files" in printed
    options = "--dt 0.005 --limits 0:75 --kp 0.05 --ti 0.02 --no-feedforward --out same"
    assert "y: the loop is unstable" in refusal(
        "contour", "x.json", "y.json", course, *options.split()
    )
    own = refusal("contour", "loop_x.json", "loop_y.json", course, "--kp", "1", "--ti", "0.1")
    assert own.startswith("--kp has no effect with controller files")
    assert "two models, or two controllers" in refusal("contour", "x.json", "loop_y.json", course)


@pytest.mark.usefixtures("_no_pictures")
def test_the_options_reach_the_stage_and_the_loops() -> None:
    options = (
        "lissajous:0.5/1Hz,5/5um --lag 0.04 --cross-talk 0.1:-0.08 --decouple --kp 0.1 "
        "--duration 4 --out a/b --seed 3"
    )
    printed = ran("contour", *options.split())
    assert "y lags by 0.04 s, 10 % of y in x, -8 % of x in y; feedforward" in printed
    assert "cross-talk identified: 10." in printed or "cross-talk identified: 9.9" in printed
    assert table("a/b/contour.csv").size == 200


def test_a_file_is_run_again_and_again() -> None:
    angle = 2.0 * np.pi * np.arange(200) / 200
    rows = zip(0.01 * np.arange(200), 50 + 8 * np.cos(angle), 50 + 4 * np.sin(angle), strict=True)
    text = "\n".join(f"{t:.2f},{x:.9f},{y:.9f}" for t, x, y in rows)
    Path("ellipse.csv").write_text("time_s,x_um,y_um\n" + text + "\n", encoding="utf-8")
    printed = ran("contour", "ellipse.csv", "--period", "2", "--duration", "6")
    assert "XYReference(ellipse.csv, 42 to 58 by 46 to 54 um, 6 s)" in printed
    rows_written = table("results/contour.csv")
    assert rows_written["desired_x_um"][0] == 0.0
    assert np.abs(rows_written["contour_error_um"][100:]).max() < 1.5
    assert "--period is for a path from a file" in refusal(
        "contour", "circle:1Hz,1um", "--period", "2"
    )


def test_a_path_may_have_the_name_of_a_formula() -> None:
    rows = "\n".join(f"{k / 50:.2f},{10 + 0.01 * k:.6f},{10 - 0.01 * k:.6f}" for k in range(60))
    Path(r"$\foo$.csv").write_text("time_s,x_um,y_um\n" + rows + "\n", encoding="utf-8")
    printed = ran("contour", "dahl.json", r"$\foo$.csv", "--beyond-reach", *PAPER)
    assert r"$\foo$.csv" in printed
    written = sorted(path.name for path in Path("results").iterdir())
    assert written == ["contour.csv", "contour.json", "contour.png", "contour.svg"]


def rest_log(name: str = "rest.csv") -> None:
    y = pt.VirtualStage.xu_li_2010(seed=1).record(np.zeros(10000), 1 / 5000.0).y
    rows = "\n".join(f"{k / 5000.0:.4f},{1e6 * value:.6f}" for k, value in enumerate(y))
    Path(name).write_text("time_s,displacement_um\n" + rows + "\n", encoding="utf-8")


def test_noise_needs_no_drive() -> None:
    rest_log()
    printed = ran("noise", "rest.csv", "--window", "0.2:")
    assert "9000 samples" in printed
    assert "0.0381" in printed
    written = sorted(path.name for path in Path("results").iterdir())
    assert written == ["noise.json", "noise.png", "noise.svg"]
    document = json.loads(Path("results/noise.json").read_text(encoding="utf-8"))
    assert document["spread"]["sd_error"] == pytest.approx(0.097e-6, rel=0.05)
    assert document["resolution"] == pytest.approx(2.5e-3 / 65536, rel=1e-4)


def test_what_cannot_be_done_is_refused_in_one_sentence() -> None:
    assert refusal("contour", "dahl.json").startswith("PATH is missing")
    assert "neither a file nor a known kind" in refusal("contour", "square:1Hz")
    assert "--beyond-reach" in refusal("contour", "dahl.json", "circle:0.1Hz,80um")
    assert "XY:YX" in refusal("contour", "circle:0.1Hz,1um", "--cross-talk", "3")
    assert "lag is -1" in refusal("contour", "circle:0.1Hz,1um", "--lag", "-1")
    assert "x: the loop is unstable" in refusal(
        "contour", "dahl.json", "circle:0.1Hz,1um", "--kp", "0.9", *PAPER
    )
    assert "3 files are given: expected two at most" in refusal(
        "contour", *("dahl.json",) * 3, "circle:0.1Hz,1um"
    )
    assert "expected one model file with --stage xu-li-2010" in refusal(
        "contour", "dahl.json", "dahl.json", "circle:0.1Hz,1um", *PAPER
    )
    assert "--stage is dahl.json without MODEL_X" in refusal(
        "contour", "circle:0.1Hz,1um", "--stage", "dahl.json"
    )
    assert "expected one model file, or that of x and of y, or xu-li-2010" in refusal(
        "contour", "dahl.json", "circle:0.1Hz,1um", *PAPER, "--stage", "dahl.json"
    )
    Path("still.csv").write_text(
        "time_s,x_um\n" + "\n".join(f"{k / 100},1.0" for k in range(200)), encoding="utf-8"
    )
    assert refusal("noise", "still.csv").startswith("still.csv: all 200 samples are")
    rest_log("short.csv")
    lines = Path("short.csv").read_text(encoding="utf-8").splitlines()[:40]
    Path("short.csv").write_text("\n".join(lines), encoding="utf-8")
    assert "short.csv: record has 39 samples: expected 100" in refusal("noise", "short.csv")
    assert not Path("results").exists()


@pytest.mark.usefixtures("_no_pictures")
def test_a_path_of_two_columns_needs_an_interval() -> None:
    t = np.arange(201) / 20.0
    rows = np.column_stack([50.0 + 10.0 * np.cos(t), 50.0 + 10.0 * np.sin(t)])
    np.savetxt("path.csv", rows, delimiter=",", header="x_um,y_um", comments="", fmt="%.4f")
    words = refusal("contour", "dahl.json", "path.csv")
    assert words.startswith("path.csv:1: no column is known to be the time: expected time_s")
    assert "--dt" in words
    options = ("--dt", "50ms", *PAPER, "--no-feedback")
    printed = ran("contour", "dahl.json", "path.csv", *options)
    assert "XYReference(path.csv, 40 to 60 by 40 to 60 um, 10" in printed
    assert "note  the path begins 78 um from the stage" in printed
