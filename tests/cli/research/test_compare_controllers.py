"""``piezotrack compare-controllers``: what it writes, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from commands import ran, refusal
from loops import model_text
from piezotrack.cli.research.compare_controllers import SPELLINGS
from piezotrack.control.comparing.contenders import CONTENDERS

COMPARE = ("compare-controllers", "dahl.json", "--stage", "xu-li-2010", "--dt", "0.02")


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("dahl.json").write_text(model_text(), encoding="utf-8")


@pytest.mark.slow
def test_controllers_are_compared_and_written() -> None:
    words = ran(
        *COMPARE, "--controllers", "inverse, PID", "--frequencies", "0.5,1,2", "--draws", "2"
    )
    assert "true error in nm rms at 50 Hz, mean of 2 draws of the noise" in words
    assert max(map(len, words.splitlines())) <= 100
    document = json.loads(Path("results/controllers.json").read_text(encoding="utf-8"))
    inverse, pid = document["controllers"]
    assert (inverse["name"], pid["name"]) == ("inverse", "PID")
    # The second-order Dahl model leaves micrometres, feedback less.
    assert pid["figures"][0][0]["rms"] < inverse["figures"][0][0]["rms"]
    assert [len(one["draws"]) for one in pid["figures"][0]] == [2] * 6
    assert 0.0 < pid["figures"][0][0]["spread"] < pid["figures"][0][0]["rms"]
    assert 0.0 < pid["figures"][0][0]["chatter"] < pid["figures"][0][0]["effort"]
    assert pid["sensitivity"] <= 2.02
    assert inverse["sensitivity"] is None
    assert Path("results/controllers.png").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--frequencies", "1,2"], "--frequencies is '1,2'"),
        (["--frequencies", "3,2,1"], "in rising order"),
        (["--controllers", "pid"], "is 'pid'"),
        (["--sensitivity", "0.5"], "is 0.5"),
        (["--draws", "0"], "--draws is 0: expected 1 to 100"),
    ],
)
def test_wrong_options_are_named(options: list[str], words: str) -> None:
    assert words in refusal(*COMPARE, *options)
    assert not Path("results").exists()


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_another_spelling_is_of_a_controller_that_is_compared(spelling: str) -> None:
    assert spelling not in CONTENDERS
    assert SPELLINGS[spelling] in CONTENDERS
    # It is taken: what is refused is the other one.
    words = refusal(*COMPARE, "--controllers", f"{spelling}, pdi")
    assert "'pdi'" in words
