"""`piezotrack campaign`: many logs, and a second call that does what is missing."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import pandas as pd
import pytest

import piezotrack as pt
from campaigns import PLAYS, flat, log
from commands import COMMAND, names, ran, refusal
from piezotrack.data.log_file import write_log

KIND = ("--model", PLAYS)


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name, record in {"a": log(), "b": log(0.9), "flat": flat()}.items():
        write_log(record, tmp_path / f"{name}.csv")


def test_many_logs_become_models_and_a_picture() -> None:
    printed = ran("campaign", "a.csv", "b.csv", "flat.csv", *KIND, "--parquet")
    assert "campaign in campaign: 3 records, 1 model, 3 tasks, 1 without a model" in printed
    assert "failed  flat.csv, prandtl-ishlinskii: the drive is constant" in printed
    campaign = pt.identification.Campaign.load("campaign")
    assert campaign.records == ["a.csv", "b.csv", "flat.csv"]
    alone = pt.identify(pt.read("a.csv"), PLAYS)
    assert pt.load(campaign[0].file).model == alone.model
    frame = pd.read_parquet("campaign/campaign.parquet")
    assert list(frame["record"]) == campaign.records
    assert {"campaign.json", "campaign.png", "campaign.svg"} <= set(names("campaign"))
    # Run again with a log more: it says the same, and that of the new one.
    before = {one.task: one.file.stat().st_mtime_ns for one in campaign if one.error is None}
    write_log(log(0.8), Path("c.csv"))
    shown = json.loads(ran("campaign", "a.csv", "b.csv", "c.csv", *KIND, "--json"))
    assert [one["record"] for one in shown["results"]] == ["a.csv", "b.csv", "c.csv"]
    assert all(Path(name).exists() for name in shown["written"])
    assert before == {task: Path("campaign", f"{task}.json").stat().st_mtime_ns for task in before}


def test_options_of_identify_and_seeds_reach_the_tasks() -> None:
    options = ("--runs", "1", "--history", "virgin", "--fix", "a1=122", "--window", "1:5")
    ran("campaign", "a.csv", "--model", "dahl", "--seeds", "3..5", *options, "--quiet")
    campaign = pt.identification.Campaign.load("campaign")
    assert [one.seed for one in campaign] == [3, 4]
    fit = pt.identify(
        pt.read("a.csv")[1.0:5.0],
        "dahl",
        method=pt.Descents(seed=3),
        history="virgin",
        parameters={"a1": 122.0},
    )
    assert campaign[0].fit.model == fit.model


def test_logs_of_one_name_are_told_apart_by_their_folders() -> None:
    for folder, factor in {"x": 1.0, "y": 0.9}.items():
        Path(folder).mkdir()
        write_log(log(factor), Path(folder, "log.csv"))
    ran("campaign", "x/log.csv", "y/log.csv", *KIND)
    records = pt.identification.Campaign.load("campaign").records
    assert records == [str(Path("x/log.csv")), str(Path("y/log.csv"))]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ("a.csv nope.csv", "nope.csv: there is no such file"),
        ("a.csv a.csv", "a.csv is given twice: expected it once"),
        ("a.csv --seeds x", "--seeds is 'x': expected a number, as 10, or A:B, as 10:20"),
        ("a.csv --seeds 4:4", "--seeds is '4:4'"),
        ("a.csv --model prandtl-ishlinskii --seeds 2", "--seeds has no effect with models that"),
        ("a.csv --threads 0", "--threads is 0: expected 1 to 256"),
        ("a.csv --threads 2 --dask x:1", "--threads and --dask: expected one of them at most"),
        ("a.csv --window 9:10", "a.csv: --window 9:10: the window from 9 s"),
        ("a.csv --out a.csv", "--out: a.csv cannot be made a folder: a.csv is a file"),
        ("a.csv --out .", "has 'a.csv', 'b.csv', 'flat.csv' and no campaign.json: expected an em"),
        ("flat.csv --model prandtl-ishlinskii", "no model was found of any log; flat.csv: the dr"),
    ],
)
def test_what_cannot_be_is_refused(arguments: str, sentence: str) -> None:
    assert sentence in refusal("campaign", *arguments.split())


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for a single process")
def test_ctrl_c_says_how_far_it_came() -> None:
    """In the middle of a search of ten thousand restarts."""
    many = ["--model", "dahl", "--runs", "10000", "--model", PLAYS, "--threads", "2"]
    with subprocess.Popen(
        [*COMMAND, "campaign", "a.csv", *many], stderr=subprocess.PIPE, text=True
    ) as process:
        deadline = time.monotonic() + 60.0
        while not list(Path("campaign").glob("?" * 32 + ".json")):
            assert time.monotonic() < deadline
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=30)
    assert process.returncode == 130
    assert said.splitlines()[-1] == (
        "piezotrack: interrupted: 1 of 2 results are in campaign, run it again for the others"
    )
