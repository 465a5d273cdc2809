"""`piezotrack tune`: what it finds and writes, and what it refuses."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import piezotrack as pt
from commands import names, ran, refusal
from loops import model_text

COURSE = ("sine:0.5Hz,10..60um,6s",)
QUICK = ("--dt", "0.02", "--parts", "pid")


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("dahl.json").write_text(model_text(), encoding="utf-8")


def parsed(text: str) -> dict[str, Any]:
    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    document: dict[str, Any] = json.loads(text, parse_constant=refuse)
    return document


def report(folder: str = "results") -> dict[str, Any]:
    return parsed(Path(folder, "tuning.json").read_text(encoding="utf-8"))


def controller(document: dict[str, Any], **parts: Any) -> pt.Controller:
    """The controller that a file describes."""
    filters = [getattr(pt, one.pop("kind"))(**one) for one in document["filters"]]
    return pt.Controller(
        dt=document["dt"]["value"],
        limits=tuple(document["limits"]["value"]),
        feedback=pt.Pid(**document["feedback"]),
        filters=filters,
        **parts,
    )


def test_what_is_written_is_a_loop_that_keeps_the_margins_and_the_error() -> None:
    options = ("--noise", "30nm", "--seed", "3", "--delay", "0.002", "--parts", "pid,low-pass")
    printed = ran("tune", "dahl.json", *COURSE, "--dt", "0.02", *options)
    assert names("results") == ["controller.json", "tuned.png", "tuned.svg", "tuning.json"]
    loaded = pt.load_controller("results/controller.json")
    assert loaded.provenance is not None
    assert [one["name"] for one in loaded.provenance["design"]["kept"]]
    document = report()
    assert document["format"] == "piezotrack-tuning"
    # A low-pass that costs more than it saves is left out.
    assert {one["kind"] for one in document["filters"]} <= {"LowPass"}
    known = pt.load("dahl.json")
    loop = controller(document, feedforward=known.inverse())
    # The loop that a person makes of the file, judged without the tuning.
    stage = pt.VirtualStage.of(known, noise=30e-9, seed=3)
    reference = pt.sine(frequency=0.5, low=10e-6, high=60e-6, duration=6.0)
    timing = pt.Timing(delay=0.002)
    run = pt.track(stage, loop, reference, timing=timing)
    (written,) = document["references"]
    assert written["metrics"]["rms_error"] == pytest.approx(run.metrics.rms_error, rel=1e-9)
    without = pt.track(stage, pt.Controller.of(known, dt=0.02), reference, timing=timing)
    assert run.metrics.rms_error < without.metrics.rms_error
    margins = pt.check_loop(known, loop, delay=0.002)
    for margin in (margins.low, margins.middle, margins.high):
        assert margin.stable
        assert margin.sensitivity <= 2.0 * 1.01
        assert (margin.gain_margin or math.inf) >= 2.0 * 0.99
        assert (margin.phase_margin or math.pi) >= 0.5 * 0.99
    kept = {one["name"]: one["value"] for one in document["kept"]}
    worst = max(one.sensitivity for one in (margins.low, margins.middle, margins.high))
    assert kept["sensitivity"] == pytest.approx(worst)
    for words in (
        "ki ",
        "active constraints: ",
        "written to results/: tuning.json, controller.json",
    ):
        assert words in printed


@pytest.mark.usefixtures("_no_pictures")
def test_margins_alone_give_gains_without_a_reference() -> None:
    printed = ran("tune", "dahl.json", *QUICK, "--json")
    document = parsed(printed)
    assert document["references"] == []
    assert document["loops"] == 0
    assert document.pop("written") == ["results/tuning.json", "results/controller.json"]
    assert document == report()
    # More delay and a stricter margin cost integral gain.
    ran("tune", "dahl.json", *QUICK, "--delay", "0.02", "--sensitivity", "1.4", "--overwrite")
    integral = [one["feedback"]["kp"] / one["feedback"]["ti"] for one in (document, report())]
    assert integral[1] < 0.7 * integral[0]
    late = pt.check_loop(pt.load("dahl.json"), controller(report()), delay=0.02)
    assert late.high.sensitivity <= 1.4 * 1.01


@pytest.mark.usefixtures("_no_pictures")
def test_the_gains_are_printed_as_options_of_track() -> None:
    printed = ran("tune", "dahl.json", *QUICK)
    (gains,) = re.findall(r"--kp .*", printed)
    with_file = ran("track", "results/controller.json", *COURSE, "--json", "--out", "file")
    by_options = ran("track", "dahl.json", *COURSE, *QUICK[:2], *gains.split(), "--json")
    errors = [json.loads(one)["metrics"]["rms_error"] for one in (with_file, by_options)]
    assert errors[1] == pytest.approx(errors[0], rel=1e-3)


@pytest.mark.usefixtures("_no_pictures")
def test_the_margins_are_those_of_python_by_default_and_in_rad() -> None:
    def bounds(*options: str) -> dict[str, float]:
        found = parsed(ran("tune", "dahl.json", *QUICK, "--json", "--overwrite", *options))
        return {one["name"]: one["bound"] for one in found["kept"]}

    usual = bounds()
    assert usual["gain_margin_dB"] == pytest.approx(20.0 * math.log10(pt.Margins().gain))
    assert usual["phase_margin_deg"] == pytest.approx(math.degrees(pt.Margins().phase))
    # What the help gives as defaults.
    given = bounds("--gain-margin", "6.02dB", "--phase-margin", "0.5rad")
    assert given == pytest.approx(usual, rel=1e-3)


@pytest.mark.slow
@pytest.mark.usefixtures("_no_pictures")
def test_spreads_add_plants_and_margins_in_degrees_are_kept() -> None:
    spread = "--mode-spread 10 --gain-spread 20 --delay-spread 0.002 --phase-margin 60"
    ran("tune", "dahl.json", *QUICK, *spread.split())
    document = report()
    assert len(document["plants"]) == 3 * 2 * 3 * 3
    kept = {one["name"]: one for one in document["kept"]}
    assert kept["phase_margin_deg"]["bound"] == pytest.approx(60.0)
    late = pt.check_loop(pt.load("dahl.json"), controller(document), delay=0.002).high
    # 20 % more gain still has a gain margin of 2.
    assert (late.gain_margin or math.inf) / 1.2 >= 2.0 * 0.99
    assert (late.phase_margin or math.pi) >= math.pi / 3.0 * 0.99


@pytest.mark.usefixtures("_no_pictures")
def test_several_references_and_no_feedforward() -> None:
    slow = "sine:0.25Hz,10..60um,8s"
    ran("tune", "dahl.json", *COURSE, slow, *QUICK, "--no-feedforward", "--minimise", "largest")
    document = report()
    reference = pt.sine(frequency=0.25, low=10e-6, high=60e-6, duration=8.0)
    run = pt.track(pt.load("dahl.json"), controller(document), reference)
    assert len(document["references"]) == 2
    metrics = document["references"][1]["metrics"]
    assert metrics["max_error"] == pytest.approx(run.metrics.max_error, rel=1e-6)


@pytest.mark.usefixtures("_no_pictures")
def test_the_calmest_command_within_an_allowed_error() -> None:
    ran("tune", "dahl.json", *COURSE, *QUICK, "--minimise", "effort", "--largest-error", "0.5um")
    (one,) = report()["references"]
    # The search leaves the samples out in which the motion settles.
    assert one["metrics"]["rms_error"] <= 1.02 * 0.5e-6


@pytest.mark.usefixtures("_no_pictures")
def test_another_stage_is_tuned_for_with_the_margins_of_both() -> None:
    known = pt.load("dahl.json")
    stage = replace(known.model, piezo_coefficient=1.3 * known.model.piezo_coefficient)
    replace(known, model=stage).save("other.json")
    printed = ran("tune", "dahl.json", *COURSE, *QUICK, "--stage", "other.json")
    assert printed.startswith("stage: other.json\n")
    document = report()
    assert len(document["plants"]) == 6
    loop = controller(document, feedforward=known.inverse())
    for model in (known, pt.load("other.json")):
        assert pt.check_loop(model, loop).high.sensitivity <= 2.0 * 1.01
    run = pt.track(pt.load("other.json"), loop, pt.sine(
        frequency=0.5, low=10e-6, high=60e-6, duration=6.0
    ))  # fmt: skip
    (written,) = document["references"]
    assert written["metrics"]["rms_error"] == pytest.approx(run.metrics.rms_error, rel=1e-9)
    # What was tuned is what `track` simulates.
    course = ("track", "results/controller.json", *COURSE, "--stage", "other.json")
    again = parsed(ran(*course, "--out", "again", "--json"))
    assert again["metrics"]["rms_error"] == written["metrics"]["rms_error"]
    assert again["true_metrics"] == written["true_metrics"]


@pytest.mark.usefixtures("_no_pictures")
def test_the_same_command_writes_the_same_bytes() -> None:
    for folder in ("one", "two"):
        ran("tune", "dahl.json", *COURSE, *QUICK, "--out", folder)
    assert Path("one/tuning.json").read_bytes() == Path("two/tuning.json").read_bytes()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--parts pid,magic", "parts is ['pid', 'magic']: expected some of 'pid', 'low-pass'"),
        ("--minimise best", "--minimise is 'best': expected one of rms, largest, effort"),
        ("--minimise effort", "--minimise is effort without --largest-error: expected"),
        (
            "--minimise effort --largest-error 0um",
            "--largest-error is 0 nm: expected an error above 0",
        ),
        ("--largest-error 1pm", "--largest-error is 1e-06 um without a reference: expected one"),
        ("--gain-margin 0", "--gain-margin is 0: expected dB, above 0 and below 400"),
        ("--phase-margin 180", "--phase-margin is 180: expected degrees, 0 to below 180"),
        ("--sensitivity nan", "--sensitivity is nan: expected a factor above 1"),
        ("--mode-spread 99", "--mode-spread is 99: expected per cent, 0 to below 95"),
        ("--gain-spread -3", "--gain-spread is -3: expected per cent, 0 to below 95"),
        ("--delay-spread -1", "--delay-spread is -1: expected a time of 0 or above"),
        ("--stage xu-li-2010 --noise 5nm", "--noise has no effect with --stage xu-li-2010"),
        ("--delay -1", "delay is -1: expected"),
        ("--dt 0", "dt is 0.0: expected"),
        ("--limits 5", "--limits is '5': expected LOW:HIGH"),
        ("blob", "reference 'blob' is neither a file nor a known kind"),
        ("sine:0.5Hz,10..600um,6s", "reference is 600 um at"),
        ("--parts notch", "parts has 'notch': expected a mode that rings"),
    ],
)
def test_wrong_options_are_named_and_nothing_is_written(options: str, words: str) -> None:
    assert words in refusal("tune", "dahl.json", "--dt", "0.02", *options.split())
    assert not Path("results", "tuning.json").exists()


def test_margins_out_of_reach_are_refused() -> None:
    """0.5 s of delay in a loop at 50 Hz: even the lowest gains keep no Ms of 1.0001."""
    options = ("--delay", "0.5", "--sensitivity", "1.0001")
    said = refusal("tune", "dahl.json", *QUICK, *options)
    assert said.startswith("--sensitivity is 1.0001: expected one that some gains can keep")


@pytest.mark.usefixtures("_no_pictures")
def test_a_gain_margin_out_of_reach_is_named_with_the_nearest() -> None:
    """The search itself ranks unstable gains before those that are short by so much."""
    message = refusal("tune", "dahl.json", *QUICK, "--gain-margin", "180")
    assert message.startswith("--gain-margin is 180 dB, a factor of 1e+09: expected one that some")
    (nearest,) = re.findall(r"the nearest gains reach ([0-9.]+) dB \(", message)
    (less,) = re.findall(r", ([0-9.]+) dB too low$", message)
    assert float(nearest) + float(less) == pytest.approx(180.0, rel=1e-3)
    # What is said to be nearest can be kept, and not much more.
    ran("tune", "dahl.json", *QUICK, "--gain-margin", f"{float(nearest) - 1.0}")
    more = ("--gain-margin", f"{float(nearest) + 3.5}", "--overwrite")
    assert "expected one that" in refusal("tune", "dahl.json", *QUICK, *more)


@pytest.mark.usefixtures("_no_pictures")
def test_results_that_exist_are_kept() -> None:
    ran("tune", "dahl.json", *QUICK)
    before = Path("results/tuning.json").read_bytes()
    assert "--overwrite" in refusal("tune", "dahl.json", *QUICK, "--seed", "2")
    assert Path("results/tuning.json").read_bytes() == before
