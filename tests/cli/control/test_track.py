"""`piezotrack track` and `piezotrack feedforward`: what they write, and what they refuse."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from commands import ran, refusal, table
from loops import PID, STAGE, fitted, loop, model_text, record, sine

COURSE = "sine:0.5Hz,0..110um,6s"
PAPER = ("--stage", "xu-li-2010")
ROWS = "time_s,desired_um,measured_um,voltage_V,feedforward_V,feedback_V,repetitive_V"


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("dahl.json").write_text(model_text(), encoding="utf-8")


def report(folder: str = "results") -> dict[str, Any]:
    text = Path(folder, "tracking.json").read_text(encoding="utf-8")

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    document: dict[str, Any] = json.loads(text, parse_constant=refuse)
    return document


# What they do.


def test_pictures_have_the_format_and_the_width_of_a_paper() -> None:
    ran("track", "dahl.json", COURSE, *PAPER, "--format", "pdf", "--width", "85mm")
    assert sorted(path.name for path in Path("results").iterdir()) == [
        "tracking.csv", "tracking.json", "tracking.pdf",
    ]  # fmt: skip
    page = Path("results/tracking.pdf").read_bytes()
    box = re.search(rb"/MediaBox \[ 0 0 ([0-9.]+) ", page)
    assert box is not None
    # 72 points an inch.
    assert 25.4 * float(box[1]) / 72.0 == pytest.approx(85.0, abs=0.1)
    # One file, of its ending.
    ran("track", "dahl.json", COURSE, *PAPER, "--out", "run.pdf")
    assert Path("run.pdf").read_bytes().startswith(b"%PDF")
    assert "results/tracking.csv exists" in refusal(
        "track", "dahl.json", COURSE, *PAPER, "--format", "pdf"
    )
    assert "85pt" in refusal("track", "dahl.json", COURSE, *PAPER, "--width", "85pt", "--out", "a")
    assert not Path("a").exists()


def test_track_writes_what_python_finds() -> None:
    printed = ran("track", "dahl.json", COURSE, *PAPER)
    written = sorted(path.name for path in Path("results").iterdir())
    assert written == ["tracking.csv", "tracking.json", "tracking.png", "tracking.svg"]
    expected = pt.track(STAGE, loop(feedforward=fitted().inverse(), feedback=PID), sine(0.5, 6.0))
    assert expected.summary() in printed
    assert printed.startswith("stage: the virtual stage of Xu and Li 2010\nReference(sine 0.5 Hz, ")
    assert "written to results/: tracking.csv .json .png .svg" in printed
    assert Path("results/tracking.csv").read_text(encoding="utf-8").startswith(ROWS + "\n")
    rows = table("results/tracking.csv")
    assert rows.size == 300
    assert np.allclose(rows["voltage_V"], expected.voltage, rtol=1e-9, atol=1e-9)
    assert np.allclose(rows["measured_um"], 1e6 * expected.measured, rtol=1e-9, atol=1e-9)
    document = report()
    assert document["format"] == "piezotrack-tracking"
    assert document["metrics"]["max_error"] == expected.metrics.max_error
    assert [one["rms_error"] for one in document["periods"]] == [
        one.rms_error for one in expected.periods
    ]
    assert document["model_drive_range"] == pytest.approx([0.0, 75.0])
    assert document["limits"] == {"value": [0.0, 75.0], "unit": "V"}


LOOP = (
    "--dt 0.01 --limits -5:60 --online --kp 0.05 --ti 0.02 --td 0.01 --tt inf "
    "--repetitive --kq 0.5 --tq 0.1 --delay 0.001 --seed 7"
)


@pytest.mark.usefixtures("_no_pictures")
def test_every_option_of_a_loop_reaches_it() -> None:
    ran(
        "track",
        "dahl.json",
        "sine:0.5Hz,10..60um,6s",
        "--out",
        "a/b",
        *PAPER,
        *LOOP.split(),
    )
    expected = pt.track(
        pt.VirtualStage.xu_li_2010(seed=7),
        pt.Controller(
            dt=0.01,
            limits=(-5.0, 60.0),
            feedforward=fitted().inverse(playback="online"),
            feedback=pt.Pid.from_um(kp=0.05, ti=0.02, td=0.01, tt=float("inf")),
            repetitive=pt.Repetitive.from_um(period=2.0, kq=0.5, tq=0.1),
        ),
        sine(0.5, 6.0, 10e-6, 60e-6),
        timing=pt.Timing(delay=0.001),
    )
    assert report("a/b")["metrics"]["rms_error"] == expected.metrics.rms_error
    assert expected.repetitive.any()


@pytest.mark.usefixtures("_no_pictures")
def test_parts_can_be_left_out() -> None:
    ran("track", "dahl.json", COURSE, *PAPER, "--no-feedback")
    alone = report()
    assert alone["feedback"] is None
    ran("track", "dahl.json", COURSE, *PAPER, "--no-feedforward", "--overwrite")
    assert report()["feedforward"] == "no feedforward"
    assert not table("results/tracking.csv")["feedforward_V"].any()
    assert report()["metrics"]["rms_error"] > 0.0


@pytest.mark.usefixtures("_no_pictures")
def test_the_model_itself_is_led_almost_perfectly() -> None:
    """With its offset: what is left is the hold of 0.002 s, half a sample late."""
    printed = ran("track", "dahl.json", "sine:0.5Hz,10..100um,6s", "--dt", "0.002")
    assert printed.startswith("stage: dahl.json\nReference(")
    assert "no feedback: --kp and --ti give a PID" in printed
    metrics = report()["metrics"]
    assert metrics["phase_lag"] == pytest.approx(np.pi * 0.001, rel=0.1)
    assert abs(metrics["mean_error"]) < 0.1e-6
    assert metrics["max_error"] < 0.3e-6


@pytest.mark.usefixtures("_no_pictures")
def test_interval_and_limits_are_those_of_the_record() -> None:
    ran("track", "dahl.json", COURSE)
    known = pt.load("dahl.json")
    assert report()["dt"]["value"] == known.dt == record().dt
    assert tuple(report()["limits"]["value"]) == known.drive_range
    assert report()["stage"] == "model"
    # A reference from a file has its own.
    t = 0.004 * np.arange(500)
    rows = [f"{a:.17g},{50.0 - 30.0 * np.cos(np.pi * a):.17g}" for a in t]
    Path("target.csv").write_text("\n".join(["time_s,displacement_um", *rows]), encoding="utf-8")
    ran("track", "dahl.json", "target.csv", "--overwrite")
    assert report()["dt"]["value"] == pytest.approx(0.004)
    ran("feedforward", "dahl.json", "target.csv")
    assert table("results/feedforward.csv").size == 500


@pytest.mark.usefixtures("_no_pictures")
def test_noise_bandwidth_and_gains_reach_ones_own_stage() -> None:
    known = pt.load("dahl.json")
    course = "sine:0.5Hz,10..100um,6s"
    options = "--dt 0.01 --noise 30nm --bandwidth 80 --kp 0.01 --ti 0.02 --seed 4"
    printed = ran("track", "dahl.json", course, *options.split())
    feedback = pt.Pid.from_um(kp=0.01, ti=0.02)
    expected = pt.track(
        pt.VirtualStage.of(known, noise=30e-9, bandwidth=80.0, seed=4),
        pt.Controller.of(known, dt=0.01, feedback=feedback),
        sine(0.5, 6.0, 10e-6, 100e-6),
    )
    assert report()["metrics"]["rms_error"] == pytest.approx(expected.metrics.rms_error, rel=1e-12)
    assert "loop at" in printed
    # Half of an error is learnt in a period.
    ran("track", "dahl.json", course, *options.split(), "--repetitive", "--overwrite")
    assert report()["periods"][-1]["rms_error"] < 0.5 * report()["periods"][0]["rms_error"]


@pytest.mark.usefixtures("_no_pictures")
def test_the_same_command_writes_the_same_bytes() -> None:
    for folder in ("one", "two"):
        ran("track", "dahl.json", COURSE, *PAPER, "--out", folder)
    for name in ("tracking.csv", "tracking.json"):
        assert Path("one", name).read_bytes() == Path("two", name).read_bytes()


@pytest.mark.usefixtures("_no_pictures")
@pytest.mark.parametrize("course", ["chirp:0.1..1Hz,0..50um,4s", "sine:0.2Hz,0..50um,2s", "levels"])
def test_every_kind_of_reference_can_be_reported(course: str) -> None:
    if course == "levels":
        rows = [f"{0.02 * k},{min(0.5 * k, 40.0)}" for k in range(200)]
        Path("levels.csv").write_text("\n".join(["time_s,target_um", *rows]), encoding="utf-8")
        course = "levels.csv"
    ran("track", "dahl.json", course, *PAPER)
    document = report()
    assert document["metrics"]["phase_lag"] is None
    assert document["periods"] == []


def test_feedforward_writes_the_table_that_python_computes() -> None:
    given = ("sine:0.5Hz,0..110um,6s", "--dt", "0.02", "--out", "ff")
    printed = ran("feedforward", "dahl.json", *given)
    names = sorted(path.name for path in Path("ff").iterdir())
    assert names == ["feedforward.csv", "feedforward.png", "feedforward.svg"]
    rows = table("ff/feedforward.csv")
    volts = fitted().inverse().played(sine(0.5, 6.0), 0.02)[0]
    assert np.allclose(rows["voltage_V"], volts, rtol=1e-9, atol=1e-9)
    assert np.allclose(rows["displacement_um"], 1e6 * sine(0.5, 6.0).sample(0.02).x, atol=1e-9)
    assert "feedforward: voltages of period" in printed
    assert "300 samples" in printed


def test_feedforward_of_a_file_leads_the_model_along_it() -> None:
    t = np.arange(2001) / 1000.0
    wanted = 30.0 - 30.0 * np.cos(2 * np.pi * 0.5 * t)
    lines = [f"{a:.17g},{b:.17g}" for a, b in zip(t, wanted, strict=True)]
    Path("target.csv").write_text("\n".join(["time_s,displacement_um", *lines]), encoding="utf-8")
    printed = ran("feedforward", "dahl.json", "target.csv", "--dt", "0.001", "--online")
    rows = table("results/feedforward.csv")
    known = pt.load("dahl.json")
    shown = known.displacement(rows["voltage_V"], 1e-3)
    late = rows["time_s"] > 1.2
    assert np.abs(shown - 1e-6 * rows["displacement_um"])[late].max() < 5e-9
    assert np.allclose(rows["displacement_um"][:2001], wanted, atol=1e-9)
    assert "computed for the whole run" in printed


@pytest.mark.usefixtures("_no_pictures")
def test_feedforward_says_where_the_model_was_not_fitted() -> None:
    course = ("sine:0.5Hz,0..200um,6s", "--limits", "0:150")
    printed = ran("feedforward", "dahl.json", *course)
    assert ", that of the record identified from 0 to 75 V" in printed


@pytest.mark.usefixtures("_no_pictures")
def test_a_rate_beyond_that_of_the_record_is_noted() -> None:
    quick = ("sine:20Hz,20..60um,1s", "--dt", "0.0005")
    printed = ran("track", "dahl.json", *quick, "--limits", "-20:95")
    assert "note  the drive moves at up to" in printed
    slow = "sine:0.2Hz,20..60um,5s"
    assert " moves at " not in ran("track", "dahl.json", slow, "--overwrite")


@pytest.mark.usefixtures("_no_pictures")
def test_a_loop_near_its_limit_is_noted() -> None:
    course = ("sine:0.2Hz,20..60um,5s", "--dt", "0.02", "--overwrite")
    printed = ran("track", "dahl.json", *course, "--kp", "0.01", "--ti", "0.1")
    assert "close to instability" not in printed
    printed = ran("track", "dahl.json", *course, "--kp", "1.8", "--ti", "0.03", "--limits", "-5:90")
    assert "note  the loop is close to instability, its gain margin is below 6 dB" in printed


@pytest.mark.usefixtures("_no_pictures")
def test_feedforward_keeps_the_limits() -> None:
    course = "sine:0.5Hz,0..110um,6s"
    ran("feedforward", "dahl.json", course, "--limits", "2:50", "--beyond-reach")
    volts = table("results/feedforward.csv")["voltage_V"]
    assert (volts.min(), volts.max()) == (2.0, 50.0)


def written_controller(name: str = "controller.json") -> pt.Controller:
    """A controller of a model, in a file; `other.json` is a stage of 1.1 times its gain."""
    controller = loop(feedforward=fitted().inverse(), feedback=PID)
    controller.save(name)
    other = pt.load("dahl.json")
    replace(
        other, model=replace(other.model, piezo_coefficient=1.1 * other.model.piezo_coefficient)
    ).save("other.json")
    return controller


@pytest.mark.usefixtures("_no_pictures")
def test_a_controller_file_is_simulated_on_its_model_and_on_another_stage() -> None:
    controller = written_controller()
    course = ("track", "controller.json", "sine:0.5Hz,10..60um,6s")
    inverse = controller.feedforward
    assert inverse is not None
    itself = pt.VirtualStage.of(inverse.stage, delay=inverse.delay)
    itself = replace(itself, sensor=replace(itself.sensor, offset=inverse.offset))
    noisy = pt.VirtualStage.of(pt.load("other.json"), noise=20e-9, seed=3)
    more = ("--stage", "other.json", "--noise", "20nm", "--seed", "3", "--delay", "0.001")
    for options, plant, delay in (((), itself, 0.0), (more, noisy, 1e-3)):
        printed = ran(*course, *options, "--overwrite")
        timing = pt.Timing(delay=delay)
        expected = pt.track(plant, controller, sine(0.5, 6.0, 10e-6, 60e-6), timing=timing)
        assert expected.summary() in printed
        document = report()
        assert document["metrics"]["rms_error"] == expected.metrics.rms_error
        assert document["true_metrics"]["rms_error"] == expected.score(true=True).rms_error
    assert document["true_metrics"]["rms_error"] < document["metrics"]["rms_error"]
    assert printed.startswith("stage: other.json, controller: controller.json\n")


@pytest.mark.usefixtures("_no_pictures")
def test_a_model_is_tracked_with_another_model_as_the_stage() -> None:
    written_controller()
    course = ("track", "dahl.json", "sine:0.5Hz,10..60um,6s", "--dt", "0.02")
    ran(*course, "--kp", "0.1", "--ti", "0.05", "--stage", "other.json")
    known, other = pt.load("dahl.json"), pt.load("other.json")
    pid = pt.Pid.from_um(kp=0.1, ti=0.05)
    expected = pt.track(
        other, pt.Controller.of(known, dt=0.02, feedback=pid), sine(0.5, 6.0, 10e-6, 60e-6)
    )
    assert report()["metrics"]["rms_error"] == pytest.approx(expected.metrics.rms_error, rel=1e-9)
    assert report()["stage"] == "other.json"


@pytest.mark.usefixtures("_no_pictures")
def test_a_controller_meets_a_stage_with_another_zero() -> None:
    written_controller()
    known = pt.load("dahl.json")
    replace(known, offset=known.offset - 112e-6).save("low.json")
    course = ("track", "controller.json", "sine:0.5Hz,10..60um,6s")
    ran(*course)
    alike = report()["metrics"]
    low = (*course, "--overwrite", "--stage", "low.json")
    said = refusal(*low)
    assert "only because the zeros differ: the stage rests at " in said
    assert ": expected --zero, with which readings count as in the model" in said
    ran(*low, "--zero")
    assert report()["metrics"] == pytest.approx(alike, abs=1e-12)
    # Two models, both from where they begin.
    both = ("track", "dahl.json", *course[2:], "--stage", "low.json", "--overwrite")
    assert "--zero" in refusal(*both)
    assert "zeroed" in ran(*both, "--zero")


def test_a_controller_file_has_gains_of_its_own() -> None:
    written_controller()
    course = ("track", "controller.json", COURSE)
    assert "--kp has no effect with a controller file" in refusal(*course, "--kp", "0.1")
    assert "--zero has no effect without --stage" in refusal(*course, "--zero")
    loop(feedback=PID).save("alone.json")
    said = refusal("track", "alone.json", COURSE)
    assert said.startswith("--stage is missing: expected a model file")


# What they refuse.

TRACK = ("track", "dahl.json", COURSE, *PAPER)
OWN = ("track", "dahl.json", COURSE)
REFUSED: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "no model": (("track", "none.json", COURSE), ("none.json", "no such file")),
    "not a model": (("track", "log.txt", COURSE), ("log.txt", "not JSON")),
    "reference": (("track", "dahl.json", "sinus:1Hz"), ("'sinus", "sine")),
    "no such file": (("track", "dahl.json", "none.csv"), ("none.csv",)),
    "reference in no unit": (
        ("track", "dahl.json", "sine:0.5,0..110um"),
        ("sine:0.5",),
    ),
    "limits": ((*TRACK, "--limits", "75"), ("--limits is '75'", "LOW:HIGH")),
    "limits of words": ((*TRACK, "--limits", "low:75"), ("--limits has 'low'", "a number")),
    "limits crossed": ((*TRACK, "--limits", "75:0"), ("limits", "the lower one first")),
    "limits not finite": ((*TRACK, "--limits", "0:nan"), ("limits", "finite")),
    "kp in V/m": ((*TRACK, "--kp", "120000"), ("kp is 1.2e+11 V/m", "0.12 V/um")),
    "kp in MV/um": ((*TRACK, "--kp", "1.2e-7"), ("kp is 0.12 V/m", "a value in V/um")),
    "kp": ((*TRACK, "--kp", "nan"), ("--kp is NaN V/m",)),
    "ti": ((*TRACK, "--ti", "0"), ("--ti is 0 s", "above 0")),
    "tt": ((*TRACK, "--tt", "0.005"), ("tt is 0.005 s", "half a sampling interval")),
    "kq": ((*TRACK, "--repetitive", "--kq", "2"), ("kq is 2 V/um", "below 2")),
    "dt": ((*TRACK, "--dt", "0"), ("dt is 0",)),
    "coarse": ((*TRACK, "--dt", "1.5s", "--tt", "9s"), ("dt is 1.5 s", "two samples")),
    "no period": (
        ("track", "dahl.json", "chirp:0.1..1Hz,0..50um,4s", "--repetitive"),
        ("--repetitive", "does not repeat"),
    ),
    "a period twice": ((*TRACK, "--period", "2"), ("--period", "from a file")),
    "stage": ((*OWN, "--stage", "real"), ("real: there is no such file",)),
    "gains without feedback": (
        (*OWN, "--ti", "0.01"),
        ("--ti has no effect without --kp: expected it left out",),
    ),
    "half of the gains": ((*OWN, "--kp", "0.01"), ("--ti is missing", "--kp 0.03V/um --ti 20ms")),
    "noise of the paper's stage": ((*TRACK, "--noise", "3nm"), ("--noise has no effect",)),
    "unstable": (
        (*OWN, "--kp", "5", "--ti", "0.1", "--dt", "0.02"),
        ("the loop is unstable on this stage", "at the limit kp would be", "V/um in place of 5"),
    ),
    "delay": ((*TRACK, "--delay", "-1"), ("delay is -1",)),
    "seed": ((*TRACK, "--seed", "-1"), ("seed is -1",)),
    "duration": (
        ("track", "dahl.json", "sine:0.5Hz,0..110um", "--duration", "-1"),
        ("duration is -1",),
    ),
    "out is a file": ((*TRACK, "--out", "log.txt"), ("--out", "log.txt", "ending in .csv")),
    "out of reach": (
        ("track", "dahl.json", "sine:0.5Hz,0..150um,6s"),
        ("150 um at 1 s", "beyond", "--beyond-reach"),
    ),
    "table out of reach": (
        ("feedforward", "dahl.json", "sine:0.5Hz,0..150um,6s"),
        ("150 um at 1 s", "beyond", "on the sensor", "--beyond-reach"),
    ),
    "nothing moves it": ((*OWN, "--no-feedforward"), ("--no-feedforward: expected --kp",)),
    "table for no model": (("feedforward", "none.json", COURSE), ("none.json", "no such file")),
    "table of no reference": (("feedforward", "dahl.json", "sinus:1Hz"), ("'sinus",)),
    "table into a file": (("feedforward", "dahl.json", COURSE, "--out", "log.txt"), ("--out",)),
    "dt of a table": (("feedforward", "dahl.json", COURSE, "--dt", "nan"), ("dt is",)),
    "a period of a text": (("feedforward", "dahl.json", COURSE, "--period", "2"), ("--period",)),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refuses_in_one_sentence(name: str) -> None:
    Path("log.txt").write_text("0 1 2\n", encoding="utf-8")
    arguments, pieces = REFUSED[name]
    sentence = refusal(*arguments)
    for piece in pieces:
        assert piece in sentence, sentence
    assert not Path("results").exists()
    assert "pt." not in sentence
    assert "=True" not in sentence


@pytest.mark.usefixtures("_no_pictures")
def test_beyond_reach_is_let_through_where_it_is_asked_for() -> None:
    course = "sine:0.5Hz,0..150um,6s"
    printed = ran("track", "dahl.json", course, "--beyond-reach")
    assert "clipped in" in printed
