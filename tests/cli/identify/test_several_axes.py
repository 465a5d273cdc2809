"""The command with several drives and displacements: logs that are realisations."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import piezotrack as pt
from commands import ran, refusal

COLUMNS = ["--drive", "a,b,c", "--displacement", "x,y,z"]


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def written(level: float) -> list[str]:
    """Write the realisations of a stage with known modes at a level as logs of two periods."""
    stage = pt.multiaxis.VirtualAxes.three(noise=1e-9, seed=1)
    record = stage.record(realisations=4, samples=512, level=level)
    both = np.concatenate([record.u, 1e6 * record.y], axis=1)
    files = []
    for k in range(4):
        rows = np.vstack([both[:, :, k, 0], both[:, :, k, 1]])
        times = record.dt * np.arange(len(rows))
        files.append(f"{level:g}_{k}.csv")
        np.savetxt(
            files[-1], np.column_stack([times, rows]), delimiter=",", comments="", fmt="%.12g",
            header="time_s,a_V,b_V,c_V,x_um,y_um,z_um",
        )  # fmt: skip
    return files


def test_modes_are_found_in_logs_of_two_levels() -> None:
    ran("identify", *written(1.0), *written(0.5), *COLUMNS, "--out", "found")
    model = pt.multiaxis.load_axes(Path("found", "axes.json"))
    assert [one.level for one in model.levels] == pytest.approx([0.5, 1.0], rel=1e-3)
    assert model.frequencies() == pytest.approx([180.0, 231.0, 262.0, 540.0, 720.0], rel=1e-4)
    assert json.loads(Path("found", "axes.json").read_text())["format"] == "piezotrack-axes"
    assert Path("found", "axes.png").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (COLUMNS, "1 realisation for 3 drives"),
        (["--drive", "a,b,c"], "--displacement is missing: expected columns of all axes"),
        ([*COLUMNS, "--model", "dahl"], "--model has no effect with several axes"),
        ([*COLUMNS, "--seed", "3"], "--seed has no effect with several axes"),
        (["--drive", "a,b,q", "--displacement", "x,y,z"], "q"),
        ([*COLUMNS, "--period", "5s"], "period"),
        (["--drive", "a", "--displacement", "x", "--period", "1s"], "--period has no effect"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_sentence(arguments: list[str], words: str) -> None:
    assert words in refusal("identify", written(1.0)[0], *arguments)


def test_a_wrong_period_is_refused() -> None:
    words = refusal("identify", *written(1.0), *COLUMNS, "--period", "90ms")
    assert "the periods of the drives differ" in words
