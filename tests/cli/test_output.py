"""What commands print and where they write: nothing is lost, one document, or nothing."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import piezotrack as pt
from commands import (
    COMMAND,
    PAPER,
    RESULTS,
    log_text,
    names,
    ran,
    refusal,
    run,
    without_progress,
    write,
    write_model,
)
from piezotrack._support.display import progress_bar
from piezotrack.identification import LeastSquares


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text(log_text(), encoding="utf-8")
    rows = [line.split(",") for line in log_text().splitlines()]
    write("drive.csv", "\n".join(f"{row[0]},{row[1]}" for row in rows))
    write_model()


QUICK = ("--model", "prandtl-ishlinskii", "--plays", "3")
# Commands with what they write first.
WRITES = {
    "identify log.csv --model prandtl-ishlinskii --plays 3": "results/prandtl-ishlinskii.json",
    "compare log.csv --model prandtl-ishlinskii --window :3": "comparison/comparison.json",
    "simulate dahl.json drive.csv": "results/simulated.csv",
    "noise log.csv": "results/noise.json",
}


@pytest.mark.slow
@pytest.mark.parametrize("command", WRITES)
def test_results_are_replaced_only_where_that_is_asked_for(command: str) -> None:
    first = Path(WRITES[command])
    document = json.loads(ran(*command.split(), "--json"))
    written = [Path(path) for path in document["written"]]
    assert sorted(written) == sorted(first.parent.iterdir())
    # Each of them is looked for.
    for path in written:
        other = Path("other", path.name)
        other.parent.mkdir(exist_ok=True)
        other.write_text("mine", encoding="utf-8")
        expected = f"{other} exists: expected --overwrite, or another --out"
        assert refusal(*command.split(), "--out", "other") == expected
        assert names("other") == [path.name]
        assert other.read_text(encoding="utf-8") == "mine"
        other.unlink()
    again = json.loads(ran(*command.split(), "--json", "--overwrite"))
    assert again == document


def test_auto_looks_for_every_kind_that_it_may_choose(monkeypatch: pytest.MonkeyPatch) -> None:
    def computed(*_: Any, **__: Any) -> None:
        raise pt.DataError("computed")

    monkeypatch.setattr("piezotrack.identification.fit.identify", computed)
    for kind in ("bouc-wen", "prandtl-ishlinskii", "first-order-dahl", "parallel-dahl"):
        Path("results").mkdir(exist_ok=True)
        path = Path("results", f"{kind}.json")
        path.write_text("mine", encoding="utf-8")
        assert refusal("identify", "log.csv").startswith(f"{path} exists")
        path.unlink()
    # Another kind is in nobody's way.
    Path("results", "dahl.json").write_text("mine", encoding="utf-8")
    assert refusal("identify", "log.csv") == "log.csv: computed"


@pytest.mark.usefixtures("_no_pictures")
def test_a_model_that_is_compared_may_lie_in_the_folder_of_the_results() -> None:
    Path("comparison").mkdir()
    write_model()
    before = Path("dahl.json").replace("comparison/dahl.json").read_bytes()
    ran("compare", "log.csv", "--model", "comparison/dahl.json")
    assert Path("comparison/dahl.json").read_bytes() == before


def test_json_has_the_figures_of_the_files() -> None:
    document = json.loads(ran("identify", "log.csv", *QUICK, "--test", "log.csv", "--json"))
    (model,) = document["models"]
    notes = model.pop("notes")
    assert model == json.loads(Path("results/prandtl-ishlinskii.json").read_text())
    assert (
        notes
        == pt.identify(pt.read("log.csv"), "prandtl-ishlinskii", method=LeastSquares(count=3)).notes
    )
    assert model["validation"]["rms"]["unit"] == "m"
    document = json.loads(ran("simulate", "dahl.json", "drive.csv", "--json"))
    assert document["samples"] == 1001
    assert document["displacement_range"]["unit"] == "m"
    document = json.loads(ran("noise", "log.csv", "--out", "n", "--json"))
    del document["written"]
    assert document == json.loads(Path("n/noise.json").read_text())


def test_quiet_prints_errors_only() -> None:
    result = run("identify", "log.csv", *PAPER, "--quiet")
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", "")
    assert names("results") == RESULTS
    assert "exists" in refusal("identify", "log.csv", *PAPER, "--quiet")


@pytest.mark.slow
def test_settings_of_least_squares_reach_the_fit() -> None:
    options = "--plays 5 --asymmetry 1 --dynamics lag --creep 0.5,2"
    ran("identify", "log.csv", "--model", "prandtl-ishlinskii", *options.split(), "--quiet")
    settings = LeastSquares(count=5, dead_zones=1, dynamics="first", creep=[0.5, 2.0])
    fit = pt.identify(pt.read("log.csv"), "prandtl-ishlinskii", method=settings)
    model = pt.load("results/prandtl-ishlinskii.json").model
    assert model == fit.model
    assert (len(model.weights), model.creep_times) == (5, (0.5, 2.0))
    assert model.time_constant is not None
    nothing = ("--plays", "2", "--asymmetry", "0", "--dynamics", "none", "--creep", "none")
    models = ("--model", "prandtl-ishlinskii", "--model", "dahl", "--runs", "1")
    ran("identify", "log.csv", *models, *nothing, "--quiet", "--overwrite")
    bare = pt.load("results/prandtl-ishlinskii.json").model
    assert (len(bare.weights), bare.dead_zone_weights, bare.creep_weights) == (2, (), ())
    assert bare.time_constant is None
    assert bare.frequency is None
    # The swarm has the creep, and none of the settings of the plays.
    assert pt.load("results/dahl.json").model.creep_weights == ()


@pytest.mark.usefixtures("_no_pictures")
@pytest.mark.usefixtures("_no_pictures")
def test_creep_reaches_what_auto_tries() -> None:
    ran("identify", "log.csv", "--creep", "0.5", "--runs", "1", "--seed", "2", "--quiet")
    (name,) = names("results")
    assert pt.load(Path("results", name)).model.creep_times == (0.5,)


# Progress where there is no terminal.


@pytest.mark.slow
def test_progress_is_told_in_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress_bar, "FIRST", 0.0)
    monkeypatch.setattr(progress_bar, "EVERY", 0.01)
    search = ("identify", "log.csv", *PAPER, "--method", "swarm", "--seed", "3")
    result = run(*search)
    assert result.exit_code == 0
    lines = result.stderr.splitlines()
    # Without a share before the first iteration of all runs.
    share = r"(?:(\d+) %(?:, up to \d+ s left)?, )?"
    pattern = rf"identify: dahl, {share}at most \d+ iterations, best \S+ um, \d+ s"
    reports = [match for line in lines if (match := re.fullmatch(pattern, line))]
    assert len(reports) > 2
    shares = [int(match[1]) for match in reports if match[1]]
    assert shares == sorted(shares)
    assert all(0 < percent <= 100 for percent in shares)
    assert without_progress(result.stderr) == ""
    quiet = run(*search, "--quiet", "--overwrite")
    assert (quiet.exit_code, quiet.stderr) == (0, "")


@pytest.mark.usefixtures("_no_pictures")
def test_least_squares_tell_their_progress_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress_bar, "FIRST", 0.0)
    monkeypatch.setattr(progress_bar, "EVERY", 0.01)
    result = run("identify", "log.csv", "--model", "prandtl-ishlinskii")
    assert re.match(r"identify: prandtl-ishlinskii, least squares, 0 s\n", result.stderr)


@pytest.mark.usefixtures("_no_pictures")
def test_nothing_is_told_of_what_takes_no_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress_bar, "FIRST", 3600.0)
    assert run("identify", "log.csv", *PAPER).stderr == ""


# Completion, and readers that leave.


@pytest.mark.slow
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete_commands_options_and_kinds(shell: str) -> None:
    def completed(*words: str) -> str:
        line = " ".join(["piezotrack", *words])
        environment = {
            "_PIEZOTRACK_COMPLETE": f"{shell}_complete",
            "COMP_WORDS": line,
            # fish gives the word itself.
            "COMP_CWORD": words[-1] if shell == "fish" else str(len(words)),
        }
        done = subprocess.run(
            [
                sys.executable,
                "-c",
                "import sys; sys.argv[0] = 'piezotrack'; from piezotrack.cli import main; main()",
            ],
            capture_output=True,
            text=True,
            timeout=60.0,
            check=False,
            env={**os.environ, **environment},
        )
        assert done.stderr == ""
        return done.stdout

    assert "identify" in completed("ide")
    assert "--model" in completed("identify", "--mod")
    assert "parallel-dahl" in completed("identify", "--model", "par")


def test_completion_can_be_installed() -> None:
    printed = ran("--help")
    assert "_PIEZOTRACK_COMPLETE=bash_source" in printed


@pytest.mark.skipif(os.name == "nt", reason="needs a POSIX shell")
def test_a_closed_pipe_ends_the_command_as_sigpipe_does() -> None:
    command = shlex.join([*COMMAND, "simulate", "dahl.json", "drive.csv"])
    done = subprocess.run(
        ["bash", "-c", f"{command} | true; exit ${{PIPESTATUS[0]}}"],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert (done.returncode, done.stderr) == (141, "")
    assert len(names("results")) == 3


# Help that fits the screen, and hints that can be followed.


def test_no_line_of_the_list_of_commands_is_cut() -> None:
    for line in ran("--help").partition("Commands:")[2].strip().splitlines():
        assert line.endswith("."), line
        assert not line.endswith("..."), line


def test_a_reference_without_header_is_told_what_this_command_can_do() -> None:
    write("bare.csv", "0,1\n1,2\n2,3\n")
    write("several.csv", "time_s,x_um,y_um\n0,1,1\n1,2,1\n2,3,1\n")
    write("unit.csv", "time_s,x\n0,1\n1,2\n2,3\n")
    for name in ("bare.csv", "several.csv", "unit.csv"):
        sentence = refusal("feedforward", "dahl.json", name)
        assert not re.search(r"--(time|drive|displacement|unit)|\w=", sentence), sentence
    write("gap.csv", "time_s,x_um\n0,1\n1,2\n2,3\n5,3\n")
    assert "resample" not in refusal("noise", "gap.csv")
    write("gap.csv", "time_s,voltage_V,x_um\n0,1,1\n1,2,1\n2,3,1\n5,3,1\n")
    assert "--resample puts it" in refusal("identify", "gap.csv")


@pytest.mark.usefixtures("_no_pictures")
def test_a_name_with_an_ending_is_the_one_result_of_that_kind() -> None:
    ran("simulate", "dahl.json", "drive.csv", "--out", "all")
    ran("simulate", "dahl.json", "drive.csv", "--out", "one/run.csv")
    assert names("one") == ["run.csv"]
    assert Path("one/run.csv").read_bytes() == Path("all/simulated.csv").read_bytes()
    assert "run.csv exists: expected --overwrite" in refusal(
        "simulate", "dahl.json", "drive.csv", "--out", "one/run.csv"
    )
    said = refusal("simulate", "dahl.json", "drive.csv", "--out", "run.json")
    assert said.startswith("--out is run.json: expected a folder, or a file ending in .csv")


def test_long_results_are_cut_and_whole_with_v() -> None:
    short = ran("track", "dahl.json", "sine:1Hz,0..9um,60s", "--limits", "0:75", "--dt", "20ms")
    long = ran(
        *("track", "dahl.json", "sine:1Hz,0..9um,60s", "--limits", "0:75", "--dt", "20ms"),
        *("--overwrite", "-v"),
    )
    shown = [line for line in short.splitlines() if line]
    assert len(shown) <= 28 < len(long.splitlines())
    more = int(re.findall(r"\.\.\. (\d+) more lines with -v", short)[0])
    assert len(short.splitlines()) - 1 + more == len(long.splitlines())
