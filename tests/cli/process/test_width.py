"""Sentences that commands print are as wide as the terminal, at most 100 columns."""

from __future__ import annotations

import re
import shutil
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from commands import run
from piezotrack.cli.output import print_words, wrapped
from piezotrack.data.log_file import write_log
from play_records import PLAIN, fit_plays, record

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.usefixtures("_no_pictures")
NOTES = re.compile(r"^note  (?:.*\n)(?:      \S.*\n)*", re.MULTILINE)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log with a glitch, a drive beyond its range, and its model."""
    folder = tmp_path_factory.mktemp("width")
    data = record(PLAIN)
    y = data.y.copy()
    y[1500] += 30e-6
    write_log(pt.Dataset(u=data.u, y=y, dt=data.dt), folder / "log.csv")
    write_log(pt.Dataset(u=2.0 * data.u, y=2.0 * y, dt=data.dt), folder / "far.csv")
    y[700:900] = np.nan
    write_log(pt.Dataset(u=data.u, y=y, dt=data.dt, missing="drop"), folder / "gaps.csv")
    fit = fit_plays(data, count=4, creep=False, dynamics=None)
    fit.save(folder / "model.json")
    return folder


COMMANDS = [
    ("info", "log.csv"),
    ("convert", "gaps.csv", "converted.csv", "--missing", "fill"),
    ("identify", "log.csv", "--model", "prandtl-ishlinskii", "--test", "far.csv"),
    ("simulate", "model.json", "far.csv"),
    ("feedforward", "model.json", "sine:20Hz,5..60um"),
    ("track", "model.json", "sine:20Hz,5..60um"),
    ("contour", "model.json", "circle:20Hz,20um"),
]


@pytest.mark.parametrize("arguments", COMMANDS, ids=lambda one: one[0])
@pytest.mark.parametrize("columns", [60, 300])
def test_notes_are_as_wide_as_the_terminal(
    arguments: tuple[str, ...],
    columns: int,
    made: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    whole = run(*arguments)
    assert whole.exit_code == 0, whole.output
    monkeypatch.setenv("COLUMNS", str(columns))
    wide = run(*arguments, "--overwrite") if arguments[0] != "info" else run(*arguments)
    notes = NOTES.findall(wide.stdout)
    assert max(len(line) for note in notes for line in note.splitlines()) <= min(columns, 100)
    said = [" ".join(note.split()) for note in notes]
    before = [line for line in whole.stdout.splitlines() if line.startswith("note  ")]
    assert said == [" ".join(line.split()) for line in before]
    assert max(map(len, before)) > 60


def test_numbers_stay_with_their_units_and_tables_as_they_are() -> None:
    note = "note  " + ", ".join(f"from {i}.5 um to {i}.75 um" for i in range(40))
    lines = wrapped(note, 80).splitlines()
    assert len(lines) > 10
    assert not any(line.strip().startswith("um") for line in lines)
    assert all(line.startswith("      ") for line in lines[1:])
    table = "  model        " + "   ".join(f"{x:9.3g}" for x in np.arange(20.0))
    command = "  piezotrack track " + " ".join(f"--option-{i} value" for i in range(20))
    path = "on " + "a" * 150
    for line in (table, command, note):
        assert wrapped(line, None) == line
    assert wrapped(table, 60) == table
    assert wrapped(command, 60) == command
    assert path[3:] in wrapped(path, 60)


def test_where_there_is_no_terminal_lines_stay_whole(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("COLUMNS", raising=False)
    line = "note  " + "word " * 60 + "end"
    print_words(line)
    assert capsys.readouterr().out == f"{line}\n"
