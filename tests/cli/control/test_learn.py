"""``piezotrack learn``: what it says before and after each trial, what it writes and refuses."""

from __future__ import annotations

import json
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from commands import names, ran, refusal, run, table

REFERENCE = ("sine:5Hz,10..50um,1s",)
LEARN = ("learn", "model.json", *REFERENCE, "--dt", "0.001", "--limits", "0:75")
REAL = ("--stage", "stage.json", "--noise", "5nm", "--mode-scales", "0.97,1,1.03")


def plays(gain: float = 1.0) -> pt.PrandtlIshlinskiiStage:
    return pt.PrandtlIshlinskiiStage(
        linear=gain * 1e-6,
        thresholds=(5.0, 15.0),
        weights=(gain * 2e-7, gain * 2e-7),
        frequency=160.0,
        damping_ratio=0.05,
    )


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, gain in (("model", 1.0), ("stage", 1.1)):
        pt.identification.IdentifiedModel(
            model=plays(gain),
            offset=0.0,
            offset_fitted=False,
            scale_assumed=False,
            stroke=1e-4,
        ).save(f"{name}.json")


def write_model_of_metres() -> None:
    """A model whose drive is a position."""
    drive = 37.5e-6 * (1.0 - np.cos(np.arange(400) / 20.0))
    log = pt.Dataset(u=drive, y=0.5 * drive, dt=0.01, drive_unit="m")
    pt.identify(log, "prandtl-ishlinskii", history="virgin").save("metres.json")


def test_the_table_that_is_written_follows_the_reference_on_the_stage() -> None:
    ran(*LEARN, *REAL, "-o", "out/table.csv")
    assert names("out") == ["table.csv"]
    written = table("out/table.csv")
    assert written["desired_um"] == pytest.approx(
        30.0 - 20.0 * np.cos(10.0 * np.pi * written["time_s"]), abs=1e-6
    )
    # Another stage like it, another draw of the noise, and no command of this package.
    stage = pt.VirtualStage.of(plays(1.1), noise=5e-9, seed=77)
    left = {}
    for name in ("voltage_V", "feedforward_V"):
        record = stage.record(list(written[name]) * 8, 1e-3, hold="zoh").y[-200:]
        left[name] = np.sqrt(np.mean((1e-6 * written["desired_um"] - record) ** 2))
    # The inverse alone is 10 % off, the table has nothing but the noise left.
    assert left["feedforward_V"] > 2e-6
    assert left["voltage_V"] < 12e-9


def test_the_convergence_is_said_before_the_first_table_and_the_errors_of_each_trial() -> None:
    lines = ran(*LEARN, *REAL, "--trials", "6").splitlines()
    assert "settled period, cutoff 250 Hz" in lines[0]
    convergence = r"slowest convergence: factor 0\.\d{3} a trial, at [\d.]+ Hz on .+; 18 models"
    assert re.fullmatch(convergence, lines[1])
    assert lines[2].split() == ["trial", "rms", "nm", "max", "nm", "noise", "nm"]
    trials = [line.split() for line in lines[3:9]]
    assert [one[0] for one in trials] == list("012345")
    errors = [float(one[1]) for one in trials]
    assert all(after < 0.6 * before for before, after in pairwise(errors[:4]))
    assert lines[9] == "ended: all trials were made"
    assert lines[10] == f"best: trial 5, {errors[5]:.4g} nm rms after {errors[0]:.4g} nm"
    assert lines[-1] == "written: learnt.csv"


def test_the_heading_is_wrapped_at_the_width_of_the_terminal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    printed = ran(*LEARN, *REAL, "--trials", "1")
    assert "slowest convergence" in printed
    assert max(map(len, printed.splitlines())) <= 80


def test_the_json_document_has_the_convergence_and_all_trials() -> None:
    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    printed = ran(*LEARN, *REAL, "--json", "--trials", "5")
    document: dict[str, Any] = json.loads(printed, parse_constant=refuse)
    assert document["format"] == "piezotrack-learning"
    assert document["written"] == ["learnt.csv"]
    assert document["stopped"] == "trials"
    assert len(document["trials"]) == 5
    errors = [one["rms_error"] for one in document["trials"]]
    assert document["best"] == int(np.argmin(errors)) > 0
    convergence = document["convergence"]
    factors = [one["factor"] for one in convergence["models"]]
    # Three gains, three frequencies of the mode, two delays.
    assert len(factors) == 18
    assert convergence["factor"] == max(factors) < 1.0
    assert ran(*LEARN, *REAL, "--quiet", "--trials", "2", "--overwrite") == ""


def test_a_folder_has_a_picture_too_and_results_are_kept() -> None:
    ran(*LEARN, *REAL, "--trials", "2", "-o", "out")
    assert names("out") == ["learnt.csv", "learnt.png", "learnt.svg"]
    before = Path("out/learnt.csv").read_bytes()
    again = (*LEARN, *REAL, "--trials", "3", "-o")
    assert "learnt.csv exists: expected --overwrite" in refusal(*again, "out")
    assert Path("out/learnt.csv").read_bytes() == before
    ran(*again, "out", "--overwrite")
    assert Path("out/learnt.csv").read_bytes() != before
    # The picture alone.
    ran(*again, "other/run.svg")
    assert names("other") == ["run.svg"]


@pytest.mark.usefixtures("_no_pictures")
def test_the_same_command_writes_the_same_bytes_and_another_seed_others() -> None:
    for name, seed in (("a", "4"), ("b", "4"), ("c", "5")):
        ran(*LEARN, *REAL, "--trials", "4", "--seed", seed, "-o", f"{name}.csv")
    one, same, other = (Path(f"{name}.csv").read_bytes() for name in "abc")
    assert one == same != other


def test_feedback_and_the_lifted_method() -> None:
    gains = ("--kp", "0.05", "--ti", "0.01")
    with_feedback = ran(*LEARN, *REAL, *gains, "--trials", "8")
    # Feedback takes the 10 % down before anything is learnt.
    first = [float(line.split()[1]) for line in with_feedback.splitlines() if line[:6] == "    0 "]
    assert first[0] < 3000.0
    # A model with hysteresis does not come back to 0 um at 0 V.
    reference = ("triangle:5Hz,0..40um,0.4s", "--beyond-reach")
    lifted = ("learn", "model.json", *reference, *LEARN[3:], *REAL, "--from-rest")
    lines = ran(*lifted, "--trials", "4", "-o", "lifted.csv").splitlines()
    assert "whole motion from rest" in lines[0]
    errors = [float(line.split()[1]) for line in lines[3:7]]
    assert min(errors) < 0.4 * errors[0]
    assert any(line.startswith("the table is at a limit in ") for line in lines)
    assert table("lifted.csv").size == 400


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("-o table.json", "--out is table.json: expected a folder, or a file ending in .csv"),
        ("-o model.json/t.csv", "model.json cannot be made a folder"),
        ("--trials 0", "trials is 0: expected 1 to 10000"),
        ("--gain 2", "gain is 2"),
        ("--cutoff 400", "learning does not converge on Prandtl-Ishlinskii"),
        ("--cutoff -1", "cutoff is -1"),
        ("--mode-scales a,1", "--mode-scales has 'a': expected a number"),
        ("--mode-scales 1,-2", "--mode-scales is -2: expected"),
        ("--delay -1", "delay is -1: expected"),
        ("--limits 5", "--limits is '5': expected LOW:HIGH"),
        ("--dt 0", "dt is 0.0: expected"),
        ("--seed 2", "--seed has no effect without --noise"),
        ("--td 0.1", "--td has no effect without --kp"),
        ("--kp 0.1", "--ti is missing"),
        ("--stage gone.json", "gone.json: there is no such file"),
        ("--stage xu-li-2010 --noise 5nm", "--noise has no effect with --stage xu-li-2010"),
        ("--stage metres.json", "--stage is metres.json, whose drive is in um: expected one in V"),
        ("--json --quiet", "--json and --quiet"),
        ("MOTION chirp:1..5Hz,10..50um,2s", "does not repeat: expected one that does"),
        ("MOTION chirp:1..5Hz,10..50um,2s", "or --from-rest"),
        ("MOTION sine:5Hz,10..500um,1s", "reference is 500 um"),
        ("--no-feedforward --cutoff 400", "learning does not converge"),
    ],
)
def test_wrong_options_are_named_and_nothing_is_written(options: str, words: str) -> None:
    Path("folder.csv").mkdir()
    write_model_of_metres()
    before = sorted(Path().rglob("*"))
    typed = options.split()
    line = [*LEARN[:2], typed[1], *LEARN[3:]] if typed[0] == "MOTION" else [*LEARN, *typed]
    assert words in refusal(*line)
    assert sorted(Path().rglob("*")) == before


def test_a_reference_is_required() -> None:
    result = run("learn", "model.json")
    assert result.exit_code == 2
    assert "REFERENCE" in result.stderr
