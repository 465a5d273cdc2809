"""Campaigns: names of tasks, what is computed again, folders, bad input."""

from __future__ import annotations

import json
import os
import pickle
import re
import subprocess
import sys
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import piezotrack as pt
from campaigns import PLAYS, QUICK, Serial, contents, flat, log, results
from folders import ROOT
from piezotrack.identification.campaigns import task as campaign_task
from piezotrack.identification.campaigns.campaign import campaign
from piezotrack.identification.campaigns.task import Task, problem_of

if TYPE_CHECKING:
    from pathlib import Path


def run(
    folder: Path, records: Any, models: Any, seeds: Any = (0,)
) -> tuple[pt.identification.Campaign, int]:
    """A campaign in this thread, and how many tasks it took."""
    serial = Serial()
    found = campaign(records, models, seeds, serial, folder=folder, progress=False)
    return found, len(serial.tasks)


# What is found.


def test_every_record_model_and_seed_is_identified_as_by_hand(tmp_path: Path) -> None:
    models = {"quick": QUICK, PLAYS: {}}
    campaign, tasks = run(tmp_path / "new" / "folder", [log(), log(0.9)], models, [3, 5])
    # Least squares need no seed.
    assert tasks == len(campaign) == 2 * (2 + 1)
    assert [(one.record, one.model, one.seed) for one in campaign[:4]] == [
        ("stage 1.csv", "quick", 3),
        ("stage 1.csv", "quick", 5),
        ("stage 1.csv", PLAYS, None),
        ("stage 0.9.csv", "quick", 3),
    ]
    for result in campaign:
        record = log() if result.record == "stage 1.csv" else log(0.9)
        seeded = {**QUICK, "method": replace(QUICK["method"], seed=result.seed or 0)}
        fit = pt.identify(record, **(seeded if result.model == "quick" else {"model": PLAYS}))
        loaded = pt.load(result.file)
        assert loaded.model == result.fit.model == fit.model
        assert (loaded.offset, result.rms, result.notes) == (fit.offset, fit.cost, fit.notes)
        assert loaded.fitted_on(record)
        # A model file of identify, and the entry of the campaign beside it.
        content = json.loads(result.file.read_bytes())
        assert content.pop("campaign")["task"] == result.task == result.file.stem
        fit.save(tmp_path / "by hand.json")
        assert content == json.loads((tmp_path / "by hand.json").read_bytes())


def test_the_default_is_the_best_kind_in_threads(tmp_path: Path) -> None:
    u = 37.5 * (1.0 - np.cos(np.arange(300) / 25.0))
    stage = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(10.0,), weights=(3e-7,))
    record = pt.Dataset(u=u, y=stage.simulate(u, 0.01).x, dt=0.01)
    found = campaign([record], folder=tmp_path, progress=False)
    assert [(one.model, one.kind, one.seed) for one in found] == [("auto", PLAYS, 0)]


@pytest.mark.parametrize("threads", [1, 2])
def test_threads_change_no_bit(threads: int, tmp_path: Path) -> None:
    models = {"quick": {**QUICK, "method": replace(QUICK["method"], runs=3)}}
    run(tmp_path / "serial", [log(), log(0.9)], models, range(2))
    with ThreadPoolExecutor(threads) as pool:
        campaign([log(), log(0.9)], models, range(2), pool, folder=tmp_path / "threads")
        # It is not shut down.
        assert pool.submit(int).result() == 0
    assert contents(tmp_path / "serial") == contents(tmp_path / "threads")


# What is done is done.


def test_a_second_run_does_only_what_is_missing(tmp_path: Path) -> None:
    _, tasks = run(tmp_path, [log()], {"quick": QUICK}, [0, 1])
    assert tasks == 2
    before = {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    again, tasks = run(tmp_path, [log()], {"quick": QUICK}, [0, 1])
    assert (len(again), tasks) == (2, 0)
    assert before == {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    # More seeds, records and models.
    assert run(tmp_path, [log()], {"quick": QUICK}, range(3))[1] == 1
    assert run(tmp_path, [log(0.9), log()], {"quick": QUICK}, range(3))[1] == 3
    campaign, tasks = run(tmp_path, [log(0.9)], {"quick": QUICK, PLAYS: {}}, [0])
    assert (len(campaign), tasks) == (2, 1)
    # All of it, without the records.
    everything = pt.identification.Campaign.load(tmp_path)
    assert len(everything) == 7
    assert set(everything.models) == {"quick", PLAYS}
    one = next(one for one in everything if one.task == campaign[0].task)
    assert (one.record, one.seed, one.fit.model) == ("stage 0.9.csv", 0, campaign[0].fit.model)


def test_a_damaged_file_and_that_of_another_task_are_computed_again(tmp_path: Path) -> None:
    campaign, _ = run(tmp_path, [log(), log(0.9)], {"quick": QUICK})
    whole = contents(tmp_path)
    campaign[0].file.write_bytes(campaign[0].file.read_bytes()[:-100])
    campaign[1].file.write_bytes(whole[f"{campaign[0].task}.json"])
    assert run(tmp_path, [log(), log(0.9)], {"quick": QUICK})[1] == 2
    assert contents(tmp_path) == whole


def test_a_task_that_finds_no_model_stops_no_other_and_is_tried_again(tmp_path: Path) -> None:
    campaign, tasks = run(tmp_path, [flat(), log()], {"quick": QUICK, PLAYS: {}})
    assert tasks == 4
    assert [one.error is None for one in campaign] == [False, False, True, True]
    assert str(campaign[0].error).startswith("the drive is constant at 1 V in the window")
    assert [one.record for one in campaign.failed] == ["flat.csv", "flat.csv"]
    assert np.isnan(campaign[0].rms)
    with pytest.raises(pt.DataError, match=r"no model was found of flat.csv: the drive is const"):
        _ = campaign[0].fit
    with pytest.raises(pt.DataError, match="is not a piezotrack model"):
        pt.load(campaign[0].file)
    assert "failed  flat.csv, quick, seed 0: the drive is constant" in campaign.summary()
    again, tasks = run(tmp_path, [flat(), log()], {"quick": QUICK, PLAYS: {}})
    assert tasks == 2
    assert len(again.failed) == 2


def test_what_failed_once_is_replaced_when_it_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def out_of_memory(*_: object, **__: object) -> None:
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr(campaign_task, "solve", out_of_memory)
        campaign, _ = run(tmp_path, [log()], {"quick": QUICK})
    assert campaign[0].error == "not enough memory"
    campaign, tasks = run(tmp_path, [log()], {"quick": QUICK})
    assert (tasks, campaign.failed, len(results(tmp_path))) == (1, (), 1)


def test_two_runs_at_a_time_write_the_same_files(tmp_path: Path) -> None:
    with ThreadPoolExecutor(2) as both:
        runs = [
            both.submit(run, tmp_path / "both", [log(), log(0.9)], {"quick": QUICK}, range(3))
            for _ in range(2)
        ]
        assert [len(one.result()[0]) for one in runs] == [6, 6]
    run(tmp_path / "alone", [log(), log(0.9)], {"quick": QUICK}, range(3))
    assert contents(tmp_path / "both") == contents(tmp_path / "alone")


def test_an_executor_that_dies_loses_nothing(tmp_path: Path) -> None:
    dying = Serial(3, BrokenProcessPool("A child process terminated. It was killed"))
    with pytest.raises(pt.ExecutorError) as caught:
        campaign([log()], {"quick": QUICK}, range(5), dying, folder=tmp_path)
    assert str(caught.value) == (
        "executor did not return 2 tasks, BrokenProcessPool: A child process terminated: "
        f"3 of 5 results are in {tmp_path}, run it again for the others"
    )
    assert run(tmp_path, [log()], {"quick": QUICK}, range(5))[1] == 2


def test_an_executor_that_never_answers_is_asked(tmp_path: Path) -> None:
    class Closed(Serial):
        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            if not args:
                raise RuntimeError("the client is closed")
            return super().submit(fn, *args, **kwargs) if not self.tasks else Future()

    with pytest.raises(pt.ExecutorError, match=r"2 tasks, RuntimeError: the client is closed: 1 o"):
        campaign([log()], {"quick": QUICK}, range(3), Closed(), folder=tmp_path)


def test_a_task_that_breaks_its_worker_does_not_take_the_others_with_it(tmp_path: Path) -> None:
    class Killed(Serial):
        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            if args[0].seed != 1:
                return super().submit(fn, *args, **kwargs)
            future: Future[Any] = Future()
            future.set_exception(RuntimeError("four workers died of it"))
            return future

    with pytest.raises(pt.ExecutorError, match="1 task, RuntimeError: four workers died of it: 3"):
        campaign([log()], {"quick": QUICK}, range(4), Killed(), folder=tmp_path)
    found, tasks = run(tmp_path, [log()], {"quick": QUICK}, range(4))
    assert (tasks, len(found)) == (1, 4)


def test_ctrl_c_keeps_what_is_finished(tmp_path: Path) -> None:
    stopped = Serial(2, KeyboardInterrupt())
    with pytest.raises(pt.Interrupted, match=r"^interrupted: 2 of 4 results are in .*, run it"):
        campaign([log()], {"quick": QUICK}, range(4), stopped, folder=tmp_path)
    assert run(tmp_path, [log()], {"quick": QUICK}, range(4))[1] == 2


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for a single process")
def test_ctrl_c_ends_the_searches_of_threads_soon() -> None:
    """The process ends within seconds of the signal, though its searches would take minutes."""
    code = """
import os, signal, sys, tempfile, threading, time
sys.path.insert(0, sys.argv[1])
import piezotrack as pt
from campaigns import QUICK, log
long = pt.ParticleSwarm(iterations=10**6, stall_iterations=10**6, min_improvement=0.0)
signal.signal(signal.SIGINT, signal.default_int_handler)
log()
threading.Timer(1.0, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
try:
    pt.campaign([log()], {"long": {**QUICK, "method": long}}, range(9), folder=tempfile.mkdtemp())
except pt.Interrupted as error:
    print(error)
"""
    helpers = ROOT / "tests" / "helpers"
    ended = subprocess.run(
        [sys.executable, "-c", code, str(helpers)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith("interrupted: 0 of 9 results are in ")


def test_a_result_that_cannot_be_written_says_how_far_it_came(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from piezotrack._support.files.writing import write_document

    left = iter(range(3))

    def full(path: Path, document: Any) -> Path:
        if next(left, None) is None:
            raise pt.DataError(f"{path.name} cannot be written: no space left on device")
        return write_document(path, document)

    monkeypatch.setattr("piezotrack.identification.campaigns.folder.write_document", full)
    with pytest.raises(pt.DataError, match=r"no space left on device; 2 of 4 results are in"):
        campaign([log()], {"quick": QUICK}, range(4), Serial(), folder=tmp_path)


# Names of tasks.


def name(record: pt.Dataset, seed: int | None = 0, **given: Any) -> str:
    return task(record, seed, **given).name


def task(record: pt.Dataset, seed: int | None = 0, **given: Any) -> Task:
    problem, methods = problem_of("dahl", given, record)
    return Task(problem=problem, methods=methods, seed=seed)


def test_the_name_of_a_task_is_that_of_what_its_result_depends_on() -> None:
    record = log()
    two = pt.Descents(runs=2)
    same = name(record, parameters={"a1": 120.0, "b1": 2e6}, method=two)
    assert re.fullmatch("[0-9a-f]{32}", same)
    # Neither the order of words, nor the kind of number, nor the threads.
    assert same == name(
        record,
        method=pt.Descents(runs=np.int64(2)),  # type: ignore[arg-type]
        parameters={"b1": 2_000_000, "a1": pt.Parameter(np.float64(120))},
    )
    planned = task(record)
    assert (
        planned.name == replace(planned, threads=7).name == pickle.loads(pickle.dumps(planned)).name
    )
    assert name(record) == name(record, offset=True) == name(record, model="dahl", method=None)
    other = pt.Dataset(u=record.u, y=record.y, dt=record.dt, hold="zoh")
    later = pt.Dataset(u=record.u, y=record.y, t=record.t + 1.0)
    swarm = pt.ParticleSwarm(iterations=201)
    names = [
        same,
        name(record),
        name(log(0.9)),
        name(record[1.0:]),
        name(record.cut(1.0)),
        name(other),
        name(later),
        name(record, 1),
        name(record, 2**60),
        name(record, 2**60 + 1),
        name(record, model="bouc-wen"),
        name(record, method=pt.ParticleSwarm()),
        name(record, method=swarm),
        name(record, delay=True),
        name(record, delay=1),
        name(record, offset=False),
        name(record, history="virgin"),
        replace(planned, version="9.9").name,
    ]
    assert len(set(names)) == len(names)


def test_the_name_of_a_task_is_the_same_in_another_process() -> None:
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); from campaigns import *; "
        "from piezotrack.identification.campaigns.task import Task, problem_of; "
        "given = {'parameters': {'mass': 0.1828, 'a1': (10.0, 500.0)}}; "
        "problem, methods = problem_of('dahl', given, log()); "
        "print(Task(problem=problem, methods=methods, seed=3).name)"
    )
    helpers = str(ROOT / "tests" / "helpers")
    done = subprocess.run(
        [sys.executable, "-c", code, helpers], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == name(log(), 3, parameters={"a1": (10.0, 500.0), "mass": 0.1828})


def test_a_worker_of_another_version_is_refused() -> None:
    newer = replace(task(log()), version="9.9")
    with pytest.raises(pt.ExecutorError, match=r"a worker has piezotrack .*: expected 9\.9"):
        campaign_task.run_task(newer)


# Bad input.


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (([],), "records is empty: expected one Dataset or more"),
        (({},), "records is empty"),
        ((log(),), r"records is Dataset\(600 .*: expected Datasets in a list, as \[log\]"),
        (("log.csv",), "records is 'log.csv': expected Datasets in a list"),
        ((["log.csv"],), "records has 'log.csv': expected Datasets, as pt.read"),
        (({"x": 3},), "records has 3 under 'x': expected Datasets"),
        (([log(), log()],), "records has the same samples twice, as 'stage 1.csv 0 to 5.99 s'"),
        (({"a": log(), "b": log()},), "twice, as 'a' and 'b': expected them once"),
        (([log()], "dahl"), r"models is 'dahl': expected several in a list, as \['dahl'\]"),
        (([log()], []), "models is empty"),
        (([log()], ["dahl", "dahl"]), "models has 'dahl' twice"),
        (([log()], [["dahl"]]), r"models has \['dahl'\]: expected names of models, or a mapping"),
        (([log()], {"a": QUICK, "b": QUICK}), "models has the same settings as 'a' and as 'b'"),
        (([log()], ["dalh"]), "models: 'dalh': model is 'dalh': .*did you mean 'dahl'"),
        (([log()], {"mine": {}}), "models: 'mine': model is 'mine': expected one of 'dahl'"),
        (([log()], {"mine": 3}), r"models\['mine'\] is 3: expected arguments of identify"),
        (([log()], {"dahl": {"method": pt.Descents(seed=3)}}), "seed 3: expected it in seeds="),
        (([log()], {"dahl": {"threads": 3}}), "'dahl' has threads: expected none, as the exec"),
        (([log()], {"dahl": {"run": 3}}), r"\['dahl'\] has 'run': expected 'model', 'parameters'"),
        (([log()], {"dahl": {"method": 3}}), "'dahl': method is 3: expected 'descents'"),
        (([log()], {"dahl": {"delay": log}}), "'dahl': delay is <.*: expected a number"),
        (([log()], {"dahl": {"drift": "yes"}}), "'dahl': drift is 'yes': expected a number"),
        (
            ([log()], {PLAYS: {"parameters": {"a1": 1}}}),
            "parameters is .*: expected none with the model",
        ),
        (([log()], {"auto": {"parameters": {"mass": 1}}}), "none with model='auto'"),
        (([log()], ["dahl"], 3), r"seeds is 3: expected several in a list, as \[0, 1\] or range"),
        (([log()], ["dahl"], []), "seeds is empty"),
        (([log()], ["dahl"], [1, 1]), "seeds has 1 twice"),
        (([log()], ["dahl"], [-1]), "seeds is -1: expected"),
        (([log()], ["dahl"], [0], 4), "executor is 4: expected a concurrent.futures.Executor"),
    ],
)
def test_bad_input_is_refused_before_anything_is_written(
    arguments: Any, sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(pt.ParameterError, match=sentence):
        campaign(*arguments, folder=tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_folder_with_other_files_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("chapter 1", encoding="utf-8")
    with pytest.raises(pt.DataError, match=r"has 'thesis.tex' and no campaign.json: expected an e"):
        run(tmp_path, [log()], {"quick": QUICK})
    assert contents(tmp_path) == {"thesis.tex": b"chapter 1"}
    # What is hidden is no reason, and pictures beside the results are none either.
    (tmp_path / "thesis.tex").rename(tmp_path / ".thesis.tex")
    assert run(tmp_path, [log()], {"quick": QUICK})[1] == 1
    (tmp_path / "campaign.png").write_bytes(b"")
    assert run(tmp_path, [log()], {"quick": QUICK})[1] == 0


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"schema_version": 3}, "has schema_version 3: this version of piezotrack reads 2"),
        ({"format": "piezotrack-model"}, "its 'format' is not 'piezotrack-campaign'"),
        ({"records": 3}, "an entry is not of the form that is written"),
    ],
)
def test_a_campaign_that_cannot_be_read_is_left_alone(
    change: dict[str, Any], sentence: str, tmp_path: Path
) -> None:
    run(tmp_path, [log()], {PLAYS: {}})
    file = tmp_path / "campaign.json"
    file.write_text(json.dumps({**json.loads(file.read_bytes()), **change}), encoding="utf-8")
    before = contents(tmp_path)
    with pytest.raises(pt.DataError, match=sentence):
        run(tmp_path, [log()], {PLAYS: {}})
    assert contents(tmp_path) == before


def test_the_folder_of_another_campaign_is_left_alone(tmp_path: Path) -> None:
    run(tmp_path, [log()], {"quick": QUICK, PLAYS: {}})
    before = contents(tmp_path)
    with pytest.raises(pt.DataError, match=r"another campaign, of the records 'stage 1\.csv', non"):
        run(tmp_path, [log(0.9)], {"quick": QUICK})
    with pytest.raises(pt.DataError, match=r"has the model 'quick' with other settings, \{'mo"):
        run(tmp_path, [log()], {"quick": {**QUICK, "delay": True}})
    assert contents(tmp_path) == before
    # A title under which nothing was found yet may be put right.
    wrong = run(tmp_path, [log()], {"new": {**QUICK, "parameters": {"nope": 1.0}}})[0]
    assert "nope" in str(wrong[0].error)
    assert (
        run(tmp_path, [log()], {"new": {**QUICK, "method": replace(QUICK["method"], runs=3)}})[
            0
        ].failed
        == ()
    )
    assert len(pt.identification.Campaign.load(tmp_path)) == 3
    # Settings with an infinity, which JSON does not have, are the same when they are read.
    swarm = {**QUICK, "method": replace(QUICK["method"], velocity_limit=np.inf)}
    for tasks in (1, 0):
        assert run(tmp_path, [log()], {"free": swarm})[1] == tasks


def test_records_of_one_name_have_titles_of_their_own(tmp_path: Path) -> None:
    whole = log()
    unnamed = pt.Dataset(u=whole.u, y=2.0 * whole.y, dt=0.01)
    parts = [whole[:3.0], whole[3.0:], unnamed]
    found, _ = run(tmp_path, parts, [PLAYS])
    titles = found.records
    assert titles[:2] == ["stage 1.csv 0 to 2.99 s", "stage 1.csv 3 to 5.99 s"]
    assert re.fullmatch("record [0-9a-f]{6}", titles[2])


# As a table.


def test_the_frame_has_a_row_for_each_task(tmp_path: Path) -> None:
    campaign, _ = run(tmp_path, [log(), flat()], {"quick": QUICK, PLAYS: {}}, [0, 1])
    frame = campaign.to_frame()
    assert list(frame["record"]) == ["stage 1.csv"] * 3 + ["flat.csv"] * 3
    assert frame["seed"].tolist()[:2] == [0, 1]
    assert frame["seed"].isna().tolist() == [False, False, True] * 2
    assert frame["kind"][0] == "dahl"
    fit = pt.load(campaign[0].file).model
    assert frame["stiffness_N/m"][0] == fit.stiffness
    assert np.isnan(frame["stiffness_N/m"][2])
    assert frame["rms_um"][0] == pytest.approx(1e6 * campaign[0].rms)
    assert frame["rms_percent"][0] == pytest.approx(100 * campaign[0].rms / log().stroke)
    assert frame["error"].isna().tolist() == [True] * 3 + [False] * 3
    assert "the drive is constant" in frame["error"][3]
    path = campaign.to_parquet(tmp_path / "table.parquet")
    pd.testing.assert_frame_equal(pd.read_parquet(path), frame)


def test_without_pyarrow_the_sentence_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    campaign, _ = run(tmp_path, [log()], [PLAYS])
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(pt.ParameterError, match="to_parquet needs pyarrow: expected it installed"):
        campaign.to_parquet(tmp_path / "table.parquet")
    assert not (tmp_path / "table.parquet").exists()


def test_the_table_shows_how_far_seeds_agree(tmp_path: Path) -> None:
    campaign, _ = run(tmp_path, [log()], {"quick": QUICK, PLAYS: {}}, range(3))
    costs = [one.rms_percent for one in campaign if one.seed is not None]
    best = campaign.best["stage 1.csv", "quick"]
    assert best.rms_percent == min(costs)
    line = next(line for line in campaign.summary().splitlines() if "quick" in line)
    words = line.split()
    assert words[2:5] == ["quick", "3", f"{min(costs):.4g}"]
    agree = sum(cost <= 1.001 * min(costs) for cost in costs)
    assert words[7] == str(agree)
    # One result has no median and no highest, and agrees with none.
    single = [line.split() for line in campaign.summary().splitlines() if f" {PLAYS} " in line]
    assert single[0][-4:-1] == ["-", "-", "-"]
    assert "<td>quick</td>" in campaign._repr_html_()
    assert repr(campaign) == "<Campaign, 1 record, 2 models, 4 tasks; see summary()>"


def test_the_picture_shows_every_task(tmp_path: Path) -> None:
    campaign, _ = run(tmp_path, [log(), flat()], {"quick": QUICK, PLAYS: {}}, [0, 1])
    figure = campaign.plot(fig=Figure())
    costs: Any = figure.axes[0]
    apart: Any = figure.axes[1]
    drawn = sorted(x for line in costs.get_lines()[:2] for x in line.get_xdata())
    assert drawn == pytest.approx(sorted(one.rms_percent for one in campaign[:3]))
    crosses = next(line for line in costs.get_lines() if line.get_label() == "no model found")
    assert len(crosses.get_xdata()) == 3
    assert [text.get_text() for text in costs.get_yticklabels()] == ["stage 1.csv", "flat.csv"]
    assert sum(len(line.get_xdata()) for line in apart.get_lines()[:2]) == 2
