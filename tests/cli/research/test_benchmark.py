"""``piezotrack benchmark``: the package's records, own logs and lists of them."""

from __future__ import annotations

import json
import os
import subprocess
import threading
import time
from pathlib import Path

import pytest

from commands import COMMAND, log_text, ran, refusal

PLAYS = ("--model", "plays-nnls")


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text(log_text(), encoding="utf-8")


def test_own_logs_are_compared_and_written() -> None:
    words = ran("benchmark", "log.csv", *PLAYS, "--window", ":2.5", "--out", "board")
    assert "log.csv (stroke" in words
    assert "fifteen lines" in words
    document = json.loads(Path("board/benchmark.json").read_text(encoding="utf-8"))
    (one,) = document["results"]
    assert (one["record"], one["model"]) == ("log.csv", "plays-nnls")
    assert [part["part"] for part in one["parts"]] == ["fitted", "rest"]
    file = Path("board/results/log.csv--plays-nnls.json")
    kept = json.loads(file.read_text(encoding="utf-8"))
    assert kept["record"]["window_s"][0] == 0.0
    assert kept["record"]["window_s"][1] < 2.5
    assert Path("board/benchmark.md").read_text(encoding="utf-8").startswith("**log.csv")
    # The same again computes nothing; --overwrite does.
    file.write_text(json.dumps({**kept, "seconds": 77.0}), encoding="utf-8")
    again = ("benchmark", "log.csv", *PLAYS, "--window", ":2.5", "--out", "board", "--json")
    assert json.loads(ran(*again))["results"][0]["seconds"] == 77.0
    assert json.loads(ran(*again, "--overwrite"))["results"][0]["seconds"] < 77.0


@pytest.mark.skipif(os.name == "nt", reason="Windows cannot tell whether a process runs")
def test_a_killed_benchmark_goes_on_with_what_it_has() -> None:
    models = ("plays-nnls", "first-order-dahl", "parallel-dahl", "dahl")
    command = ["benchmark", "log.csv", *(part for name in models for part in ("--model", name))]
    first = Path("benchmark/results/log.csv--plays-nnls.json")
    with subprocess.Popen([*COMMAND, *command, "--quiet"]) as process:
        until = time.monotonic() + 120.0
        while not first.exists() and time.monotonic() < until:
            threading.Event().wait(0.01)
        process.kill()
    kept = {path: path.read_bytes() for path in Path("benchmark/results").glob("log*.json")}
    assert first in kept
    assert all(json.loads(content)["record"]["name"] == "log.csv" for content in kept.values())
    ran(*command, "--quiet")
    assert {path: path.read_bytes() for path in kept} == kept
    document = json.loads(Path("benchmark/benchmark.json").read_text(encoding="utf-8"))
    assert [one["model"] for one in document["results"]] == list(models)


def test_a_list_says_of_each_log_what_is_fitted() -> None:
    rows = [line.split(",") for line in log_text().splitlines()]
    steeper = [rows[0], *([t, u, f"{1.1 * float(y):.6f}"] for t, u, y in rows[1:])]
    Path("second.csv").write_text("\n".join(map(",".join, steeper)), encoding="utf-8")
    Path("logs").mkdir()
    Path("logs/list.txt").write_text(
        "# my stages\n\n../log.csv window=0.5:2 test-window=2:3  # the old one\n"
        "../second.csv other=../log.csv other-window=1:\n",
        encoding="utf-8",
    )
    ran("benchmark", "--list", "logs/list.txt", *PLAYS, "--quiet")
    document = json.loads(Path("benchmark/benchmark.json").read_text(encoding="utf-8"))
    assert [
        (one["record"], [part["part"] for part in one["parts"]]) for one in document["results"]
    ] == [("log.csv", ["fitted", "rest"]), ("second.csv", ["fitted", "other log"])]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--model", "dal"], "--model has 'dal'"),
        (["--record", "none"], "records has 'none'"),
        (["--window", "1:2"], "--window has no effect without a FILE"),
        (["--dt", "0.1"], "--dt has no effect without a FILE or --list"),
        (["--list", "gone.txt"], "gone.txt cannot be read"),
        (["--list", "empty.txt"], "empty.txt: no log is listed"),
        (["--list", "bad.txt"], "bad.txt:2: 'from=3': expected NAME=VALUE"),
        (["--list", "window.txt"], "window.txt:1: other-window has no effect without other="),
        (["log.csv", "log.csv"], "records has log.csv twice"),
        (["log.csv", "--window", "3"], "--window is '3'"),
        (["log.csv", "--window", "30:40"], "log.csv: --window"),
        (["gone.csv"], "gone.csv: there is no such file"),
        (["--json", "--quiet"], "--json and --quiet"),
        (["log.csv", "--model", "discrete-backlash"], "no model was found of any record"),
    ],
)
def test_wrong_options_are_named(options: list[str], words: str) -> None:
    Path("empty.txt").write_text("# nothing\n", encoding="utf-8")
    Path("window.txt").write_text("log.csv other-window=3:\n", encoding="utf-8")
    Path("bad.txt").write_text("log.csv\nlog.csv from=3\n", encoding="utf-8")
    assert words in refusal("benchmark", *options)
