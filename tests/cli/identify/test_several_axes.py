"""The command with several drives and displacements: logs that are realisations."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

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


def saved(name: str, *, level: float = 1.0, **changes: Any) -> str:
    """Write a record of two axes as arrays of a file of NumPy."""
    record = pt.multiaxis.VirtualAxes.xu_li_2010(noise=1e-9, seed=1).record(
        realisations=4, samples=256, level=level
    )
    arrays = {"u": record.u, "y": 1e6 * record.y, "dt": record.dt}
    np.savez(name, **{k: v for k, v in (arrays | changes).items() if v is not None})
    return name


@pytest.mark.usefixtures("_no_pictures")
def test_records_are_read_from_arrays() -> None:
    ran("identify", saved("one.npz"), saved("half.npz", level=0.5), "-o", "found")
    model = pt.multiaxis.load_axes(Path("found", "axes.json"))
    assert [one.level for one in model.levels] == pytest.approx([0.5, 1.0], rel=1e-6)
    assert model.frequencies() == pytest.approx([160.0, 160.0], rel=1e-4)
    gains = pt.multiaxis.VirtualAxes.xu_li_2010().static_gain
    np.testing.assert_allclose(model.static_gain(), gains, atol=1e-9)


@pytest.mark.usefixtures("_no_pictures")
def test_arrays_of_one_file_are_levels() -> None:
    arrays: dict[str, Any] = {}
    for name, level in (("a", 0.5), ("b", 1.0)):
        with np.load(saved("one.npz", level=level)) as one:
            arrays |= {f"u_{name}": one["u"], f"y_{name}": one["y"], "dt": one["dt"]}
    np.savez("both.npz", **arrays)
    names = ("--drive", "u_a,u_b", "--displacement", "y_a,y_b")
    ran("identify", "both.npz", *names, "-o", "found")
    model = pt.multiaxis.load_axes(Path("found", "axes.json"))
    assert [one.level for one in model.levels] == pytest.approx([0.5, 1.0], rel=1e-6)
    assert "no array 'u': expected drives" in refusal("identify", "both.npz")
    assert "1 arrays: expected 2" in refusal("identify", "both.npz", *names[:3], "y_a")


@pytest.mark.parametrize(
    ("changes", "arguments", "words"),
    [
        (
            {"dt": None},
            [],
            "no number 'dt', the sampling interval in s: expected it there",
        ),
        ({"dt": np.ones(2)}, [], "no number 'dt'"),
        ({"y": np.ones((255, 2, 4, 2))}, [], "r.npz: y has 255 samples: expected 256"),
        ({"y": np.ones((256, 2, 3, 2))}, [], "r.npz: y has 3 realisations: expected 4"),
        ({"y": None}, [], "has no array 'y': expected drives and displacements among u, dt"),
        ({}, ["--displacement", "x"], "has no array 'x'"),
        ({}, ["--skip", "2"], "--skip is given for r.npz: expected dt and the unit"),
        ({}, ["--period", "256ms"], "--period is given for r.npz: expected none"),
        ({}, ["--model", "dahl"], "--model has no effect with several axes"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(
    changes: dict[str, Any], arguments: list[str], words: str
) -> None:
    assert words in refusal("identify", saved("r.npz", **changes), *arguments)


def test_one_realisation_is_too_few() -> None:
    with np.load(saved("r.npz")) as arrays:
        saved("one.npz", **{k: arrays[k][:, :, :1] for k in ("u", "y")})
    assert "1 realisation for 2 drives" in refusal("identify", "one.npz")
