"""The demonstration: what it says of the measured logs holds, and what it advises to type runs."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import piezotrack as pt
from commands import names, ran, refusal, run


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("demonstration")
    done = run("demo", "--out", str(folder / "demo"))
    assert done.exit_code == 0, done.output
    # Its progress is on stderr.
    return folder, str(done.stdout)


@pytest.mark.slow
def test_the_files_are_there_and_listed(printed: tuple[Path, str]) -> None:
    folder, text = printed
    pictures = [
        *("before_and_after", "other_loop", "other_time"),
        *("asymmetric-prandtl-ishlinskii_loop", "asymmetric-prandtl-ishlinskii_time"),
    ]
    files = [f"{name}.{ending}" for name in pictures for ending in ("png", "svg")]
    files += ["log.csv", "other.csv", "asymmetric-prandtl-ishlinskii.json"]
    assert names(str(folder / "demo")) == sorted(files)
    (line,) = re.findall("^written to (.*)", text, re.MULTILINE)
    assert line.startswith(f"{folder / 'demo'}/: ")
    assert all(Path(name).stem in line for name in files)


def test_the_logs_are_the_measured_ones(printed: tuple[Path, str]) -> None:
    for name, measured in (
        ("log", pt.datasets.dbo_training()),
        ("other", pt.datasets.dbo_tracking()),
    ):
        log = pt.read(printed[0] / "demo" / f"{name}.csv")
        assert np.array_equal(log.u, measured.u)
        assert np.ptp(log.y - measured.y) < 1e-12
    assert pt.read(printed[0] / "demo" / "log.csv")[3.0:23.0].y.min() == pytest.approx(0.0)


def test_the_model_is_as_good_as_it_says_on_the_other_log(printed: tuple[Path, str]) -> None:
    folder, text = printed
    match = re.search(r"other log, not fitted: rms (\S+) um \((\S+) % of stroke\)", text)
    assert match is not None
    model = pt.load(folder / "demo" / "asymmetric-prandtl-ishlinskii.json")
    score = model.score(pt.read(folder / "demo" / "other.csv")[3.0:])
    assert 1e6 * score.rms == pytest.approx(float(match[1]), rel=1e-3)
    # A Dahl model leaves 1.2 %, and the noise of the sensor 0.1 %.
    assert 0.2 < float(match[2]) < 0.45


def test_each_part_of_the_controller_lowers_the_error(printed: tuple[Path, str]) -> None:
    matches = re.findall(r"^  (\S.*?) +max (\S+) um, rms (\S+) um", printed[1], re.MULTILINE)
    assert [name for name, *_ in matches] == ["without compensation", "inverse", "inverse and PID"]
    before, inverse, both = (float(largest) for _, largest, _ in matches)
    # A piezo's loop is about a tenth to a fifth of its 37 um of travel.
    assert 37 * 0.08 < before < 37 * 0.2
    assert inverse < before / 2
    # Of the largest error of the readings, 0.3 um is the noise: five times 65 nm.
    assert both - 0.3 < (inverse - 0.3) / 2
    assert float(matches[2][2]) < float(matches[1][2]) / 2


def test_what_it_advises_to_type_runs(
    printed: tuple[Path, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(printed[0])
    text = printed[1].replace("\\\n", "")
    commands = [shlex.split(line)[1:] for line in re.findall("^  (piezotrack .*)", text, re.M)]
    assert [words[0] for words in commands] == ["identify", "compare", "track", "feedforward"]
    tracked = ran(*commands[2])
    # The stage is the model itself here: at most what the demonstration says of another.
    largest = re.search(r"max (\S+) um, rms", tracked)
    assert largest is not None
    assert float(largest[1]) < 0.6
    assert "800 samples" in ran(*commands[3])
    for words in commands[:2]:
        assert all(Path(word).exists() for word in words if word.endswith(".csv"))
        options = {word for word in words if word.startswith("--")}
        assert options <= set(re.findall(r"--[a-z-]+", ran(words[0], "--help")))


def test_it_does_not_replace_its_results_unasked(printed: tuple[Path, str]) -> None:
    said = refusal("demo", "--out", str(printed[0] / "demo"))
    assert "log.csv exists" in said
    assert "--overwrite" in said
