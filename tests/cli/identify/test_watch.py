"""``piezotrack watch``: its exit codes, its document, and the model that it writes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import piezotrack as pt
from commands import ran, refusal, run
from watched_records import DT, model_watched, watched


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    model_watched().save("model.json")


def test_an_unchanged_stage_exits_with_0() -> None:
    watched(22, top=55.0).save("log.csv")
    words = ran("watch", "model.json", "log.csv")
    assert "changed:" not in words
    # No file was written, and none is listed.
    assert words.rstrip().endswith("included")
    assert ran("watch", "model.json", "log.csv", "--quiet") == ""


def test_a_changed_stage_exits_with_3_and_a_document() -> None:
    watched(31, gain=1.02).save("log.csv")
    result = run("watch", "model.json", "log.csv", "--json")
    assert (result.exit_code, result.stderr) == (3, "")
    document = json.loads(result.stdout)
    assert document["format"] == "piezotrack-health"
    assert document["healthy"] is False
    gain = next(one for one in document["changes"] if one["name"] == "gain")
    assert gain["verdict"] == "changed"
    assert gain["value"] == pytest.approx(0.02, abs=1e-3)
    assert document["written"] == []


def test_a_refit_is_written_where_it_is_better() -> None:
    watched(31, gain=1.02).save("log.csv")
    result = run("watch", "model.json", "log.csv", "--refit", "new/model.json", "--json")
    assert result.exit_code == 3
    document = json.loads(result.stdout)
    assert document["refit"]["accepted"] is True
    assert document["written"] == [str(Path("new/model.json"))]
    watched(42, gain=1.02).save("later.csv")
    ran("watch", "new/model.json", "later.csv", "--quiet")
    # What exists is kept.
    assert "--overwrite" in refusal("watch", "model.json", "log.csv", "--refit", "new/model.json")


def test_a_refit_that_is_not_better_is_not_written() -> None:
    watched(41, samples=1500).save("log.csv")
    words = ran("watch", "model.json", "log.csv", "--refit", "new.json")
    assert "refit not accepted" in words
    assert not Path("new.json").exists()


def test_what_cannot_be_watched_is_refused() -> None:
    log = watched(9)
    pt.Dataset(u=1e-6 * log.u, y=log.y, dt=DT, drive_unit="m").save("moved.csv")
    said = refusal("watch", "model.json", "moved.csv")
    assert "moved.csv: record is driven in um: expected a drive in V" in said
    log.save("log.csv")
    assert "expected 100 or more" in refusal("watch", "model.json", "log.csv", "--window", "0:0.05")
