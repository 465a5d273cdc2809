"""``piezotrack identify`` with several logs: one model of all of them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import piezotrack as pt
from commands import names, ran, refusal, write
from piezotrack.data.log_file import write_log
from records import HELD

DT = 4e-3
KINDS = ("--model", "dahl", "--fix", "stiffness=26065", "--history", "virgin", "--seed", "1")
FIXED = tuple(part for name, value in HELD.items() for part in ("--fix", f"{name}={value}"))


def log(name: str, size: float, late: int, offset: float) -> pt.Dataset:
    """A log of the published stage, read some samples late."""
    t = DT * np.arange(1000)
    u = size * (1.0 - np.cos(np.pi * t) + 0.2 * np.sin(12.0 * np.pi * t))
    x = pt.DahlStage.xu_li_2010().simulate(u, DT).x
    read = np.concatenate([np.zeros(late), x[: x.size - late]])
    noise = 1e-8 * np.random.default_rng(late).standard_normal(t.size)
    return pt.Dataset(u=u, y=read + offset + noise, dt=DT, source=name)


@pytest.fixture(autouse=True)
def _logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_log(log("a.csv", 30.0, 0, 0.0), Path("a.csv"))
    write_log(log("b.csv", 20.0, 5, 3e-6), Path("b.csv"))


def test_several_logs_give_one_model() -> None:
    options = (
        "--window",
        "0:3",
        "--window",
        "0.4:",
        "--sensor-delay",
        "0",
        "--sensor-delay",
        "fit",
    )
    weights = ("--weight", "1", "--weight", "2")
    printed = ran("identify", "a.csv", "b.csv", *KINDS, *FIXED, *options, *weights, "-v")
    fit = pt.identify(
        [
            pt.Record(pt.read("a.csv")[0.0:3.0], delay=0.0, history="virgin"),
            pt.Record(pt.read("b.csv")[0.4:], delay=True, history="virgin", weight=2.0),
        ],
        "dahl",
        parameters={**HELD, "stiffness": 26065.0},
        method=pt.Descents(seed=1),
    )
    read = pt.load("results/dahl.json")
    assert read.model == fit.model
    assert [one.weight for one in read.records] == [1.0, 2.0]
    assert read.records[1].delay == pytest.approx(5 * DT, abs=2e-4)
    assert [one.origin["source"] for one in read.records] == ["a.csv", "b.csv"]
    for text in ("from 2 records", "   1  a.csv, 750 samples", "   2  b.csv, 900 samples"):
        assert text in printed
    assert "weight 2" in printed
    # A loop and a time course of each log.
    written = names("results")
    for panel in ("loop", "time"):
        assert {f"dahl_{panel}.png", f"dahl_{panel}_2.png"} <= set(written)
    assert "written to results/: dahl.json" in printed


@pytest.mark.slow
def test_an_option_given_once_is_for_all_logs() -> None:
    given = ("--sensor-delay", "fit", "--window", "1:", "--json")
    document = json.loads(ran("identify", "a.csv", "b.csv", *KINDS, *FIXED, *given))
    (model,) = document["models"]
    delays = [one["delay"]["value"] for one in model["records"]]
    assert delays == pytest.approx([0.0, 5 * DT], abs=5e-4)
    assert [one["data"]["window_s"][0] for one in model["records"]] == [1.0, 1.0]


@pytest.mark.usefixtures("_no_pictures")
def test_several_logs_share_the_creep_of_a_model_that_is_searched() -> None:
    document = json.loads(
        ran("identify", "a.csv", "b.csv", *KINDS, *FIXED, "--creep", "1,5", "--json")
    )
    (model,) = document["models"]
    assert model["parameters"]["creep_times"]["value"] == [1.0, 5.0]
    # The stage has none.
    assert max(model["parameters"]["creep_weights"]["value"]) < 1e-3


@pytest.mark.slow
def test_a_model_of_several_logs_is_used_like_any_other() -> None:
    ran(
        "identify",
        "a.csv",
        "b.csv",
        *KINDS,
        *FIXED,
        "--sensor-delay",
        "0",
        "--sensor-delay",
        "0.02",
    )
    ran("simulate", "results/dahl.json", "b.csv", "--out", "simulated.csv")
    train = ("--window", "0:2", "--test-window", "2:4")
    ran("identify", "a.csv", *KINDS, *FIXED, "--test", "b.csv", "--out", "one")
    assert "dahl" in ran("compare", "b.csv", "--model", "results/dahl.json", *train).lower()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--window", "0:1", "--window", "0:2", "--window", "0:3"), "--window is given 3 times"),
        (
            ("--sensor-delay", "0", "--sensor-delay", "0", "--sensor-delay", "0"),
            "--sensor-delay is given 3 times with 2 logs",
        ),
        (("--weight", "0"), "record 1 (a.csv): --weight is 0: expected a finite number above 0"),
        (("--weight", "1", "--weight", "-1"), "record 2 (b.csv): --weight is -1"),
        (("--history", "virgin", "--history", "old"), "--history is 'old'"),
        (("--window", "0:1", "--window", "9:"), "b.csv: --window 9:"),
        (("--creep", "1,0"), "creep[1] is 0 s: expected a finite number above 0"),
    ],
)
def test_refusals_name_the_option_or_the_log(options: tuple[str, ...], said: str) -> None:
    kinds = KINDS[:4] if "--history" in options else KINDS
    assert said in refusal("identify", "a.csv", "b.csv", *kinds, *FIXED, *options)
    assert not Path("results").exists()


def test_what_several_logs_cannot_have_is_refused() -> None:
    assert "--weight has no effect with 1 log" in refusal("identify", "a.csv", "--weight", "2")
    write("broken.csv", "time,drive\n1,2\n")
    assert refusal("identify", "a.csv", "broken.csv", "--model", "dahl").startswith("broken.csv")


@pytest.mark.slow
def test_windows_of_one_log_are_several_records() -> None:
    options = ("--window", "0:2", "--window", "2:4", "--sensor-delay", "0", "--json")
    document = json.loads(ran("identify", "a.csv", *KINDS, *FIXED, *options))
    (model,) = document["models"]
    spans = [one["data"]["window_s"] for one in model["records"]]
    assert [round(start) for start, _ in spans] == [0, 2]
    assert all(end - start == pytest.approx(2.0, abs=0.01) for start, end in spans)
