"""`piezotrack export`: what it writes and prints."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import piezotrack as pt
from c_exports import checked, compiled, needs_gcc, needs_linux
from commands import names, ran, refusal

PI = pt.Pid.from_um(kp=0.05, ti=0.02)
PLAYS = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(5e-7,))


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def save(name: str = "loop.json", **parts: object) -> pt.Controller:
    given: dict[str, object] = {"dt": 0.02, "limits": (0.0, 75.0), "feedback": PI} | parts
    controller = pt.Controller(**given)  # type: ignore[arg-type]
    controller.save(name)
    return controller


@needs_gcc
def test_the_c_of_a_file_is_that_of_the_controller() -> None:
    save("x-axis.json")
    output = ran("export", "x-axis.json", "--out", "c")
    assert names("c") == ["check.c", "vectors.csv", "x_axis.c", "x_axis.h"]
    assert "state 168 bytes; a step has 10 additions, 4 multiplications" in output
    compiled(Path("c"), "check.c", "x_axis.c")
    assert checked(Path("c"))[0] == 0
    before = Path("c/x_axis.c").read_bytes()
    assert "exists: expected --overwrite" in refusal("export", "x-axis.json", "--out", "c")
    output = ran("export", "x-axis.json", "--out", "c", "--overwrite", "--float", "--json")
    document = json.loads(output)
    assert document["state_bytes"] == 96
    assert document["bound"] == pytest.approx(1.5e-3)
    assert Path("c/x_axis.c").read_bytes() != before


def test_a_refused_export_leaves_no_folder() -> None:
    save(span=(-2e-5, 1.5e-4), dt=1e-4)
    assert "--clock is 0.1 MHz" in refusal("export", "loop.json", "--clock", "100kHz", "--out", "c")
    assert not Path("c").exists()
    Path("c").mkdir()
    refusal("export", "loop.json", "--clock", "100kHz", "--out", "c")
    assert Path("c").is_dir()


def test_a_motion_beyond_the_reach_is_refused_as_by_track() -> None:
    """At 5 um the settled loop of this stage needs less than 5 V."""
    controller = save(feedforward=PLAYS.inverse(), limits=(5.0, 75.0))
    form = ("--to", "json", "--json", "--out")
    assert controller.feedforward is not None
    for low, high in ((5, 60), (40, 200)):
        motion = f"sine:0.5Hz,{low}..{high}um,4s"
        with pytest.raises(pt.ParameterError) as track:
            pt.track(PLAYS, controller, motion)
        said = refusal("export", "loop.json", motion, *form, "no")
        ends = str(track.value).replace("beyond_reach=True", "--beyond-reach")
        assert said.split(" is ", 1)[1] == ends.split(" is ", 1)[1]
        assert not Path("no").exists()
    far = ("sine:0.5Hz,5..60um,4s", "--beyond-reach", *form)
    note = json.loads(ran("export", "loop.json", *far, "far"))["note"]
    reference = pt.sine(frequency=0.5, low=5e-6, high=60e-6, duration=4.0)
    table = controller.feedforward.table(reference, 0.02, limits=controller.limits)
    assert f"5 to 75 V, in {np.sum(table < 5.0)} of {table.size} samples" in note
    near = ("sine:0.5Hz,40..60um,4s", *form)
    assert json.loads(ran("export", "loop.json", *near, "near"))["note"] == ""
    assert "no effect without REFERENCE" in refusal("export", "loop.json", "--beyond-reach")


@needs_gcc
def test_a_feedforward_is_played_from_a_table() -> None:
    save(feedforward=PLAYS.inverse())
    said = refusal("export", "loop.json")
    assert said.startswith("loop.json: feedforward is the inverse of a Prandtl-Ishlinskii stage")
    assert "REFERENCE" in said
    motion = ("sine:0.5Hz,5..60um,4s", "--name", "axis")
    ran("export", "loop.json", *motion, "--out", "c")
    compiled(Path("c"), "check.c", "axis.c")
    assert checked(Path("c"))[0] == 0
    ran("export", "loop.json", *motion, "--to", "json", "--out", "j")
    document = json.loads(Path("j/axis.json").read_text(encoding="utf-8"))
    assert len(document["feedforward_table_V"]) == 100


@needs_gcc
def test_what_was_learnt_is_played() -> None:
    save()
    volts = [10.0 + k % 50 for k in range(100)]
    rows = (f"{0.02 * k},{v},{v}" for k, v in enumerate(volts))
    Path("line.csv").write_text("\n".join(["time_s,voltage_V,feedforward_V", *rows]))
    for form in ("c99", "json"):
        ran("export", "loop.json", "--table", "line.csv", "--to", form, "--out", form)
    compiled(Path("c99"), "check.c", "loop.c")
    assert checked(Path("c99"))[0] == 0
    document = json.loads(Path("json/loop.json").read_text(encoding="utf-8"))
    assert document["feedforward_table_V"] == volts
    both = ("--table", "line.csv", "sine:0.5Hz,5..60um,4s")
    assert "expected one of them" in refusal("export", "loop.json", *both, "--out", "no")
    Path("fast.csv").write_text("time_s,voltage_V\n0,1\n0.001,2\n0.002,1\n")
    said = refusal("export", "loop.json", "--table", "fast.csv", "--out", "no")
    assert "samples every 1 ms: expected those of the controller, every 20 ms" in said


@needs_linux
def test_a_unit_is_written() -> None:
    save()
    said = ran("export", "loop.json", "--to", "fmu", "--quiet")
    assert said == ""
    assert names("results") == ["loop.fmu"]


def test_the_name_of_a_file_that_is_none_of_c() -> None:
    save("2nd.json")
    assert "--name gives one" in refusal("export", "2nd.json")
    assert "name is 'pid', as functions" in refusal("export", "2nd.json", "--name", "pid")
    ran("export", "2nd.json", "--name", "second", "--to", "json")
    assert names("results") == ["second.json"]
