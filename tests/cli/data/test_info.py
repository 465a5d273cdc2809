"""``piezotrack info`` and ``piezotrack convert``."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import piezotrack as pt
from commands import log_text, ran, refusal, run, write, write_model
from piezotrack.cli.options import WINDOW

ENDINGS = ["csv", "npz", "mat", "parquet"]


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text(log_text(), encoding="utf-8")


def test_info_in_words() -> None:
    output = ran("info", "log.csv")
    for piece in ("log.csv  CSV, 3 columns", "voltage_V", "rate", "gaps      none", "reverses"):
        assert piece in output
    assert "can determine" in output
    assert "is not read" not in output


def test_info_as_a_document() -> None:
    document = json.loads(ran("info", "log.csv", "--json"))
    assert document["format"] == "piezotrack-info"
    assert document["time"]["samples"] == 1001
    assert document["roles"]["drive"] == "voltage_V"


def test_info_says_in_options_what_is_missing() -> None:
    write("bare.csv", log_text().replace("voltage_V", "voltage", 1))
    said = ran("info", "bare.csv")
    assert "is not read as it is: column 'voltage' has no unit" in said
    assert "--unit drive=..." in said
    assert "is not read" not in ran("info", "bare.csv", "--unit", "drive=V")


def test_info_refuses_what_is_no_log() -> None:
    assert refusal("info", "gone.csv").startswith("gone.csv: there is no such file")
    write("log.npz", b"PK\x03\x04")
    assert "is not a sound NPZ file" in refusal("info", "log.npz")
    assert "'volts' is not a column" in refusal("info", "log.csv", "--drive", "volts")


@pytest.mark.parametrize("ending", ENDINGS)
def test_convert_keeps_every_number(ending: str) -> None:
    if ending == "parquet":
        pytest.importorskip("pyarrow")
    said = ran("convert", "log.csv", f"out.{ending}")
    assert f"out.{ending}" in said
    before, after = pt.read("log.csv"), pt.read(f"out.{ending}")
    assert np.array_equal(before.u, after.u)
    assert np.array_equal(before.y, after.y)
    assert np.array_equal(before.t, after.t)
    ran("convert", f"out.{ending}", "back.csv")
    assert np.array_equal(pt.read("back.csv").y, before.y)


def test_convert_takes_columns_and_units() -> None:
    np.savez("raw.npz", a=np.arange(50.0) % 7, b=np.arange(50.0) % 5)
    columns = ["--drive", "a", "--displacement", "b", "--unit", "a=mV", "--unit", "b=nm"]
    ran("convert", "raw.npz", "out.csv", *columns, "--dt", "0.5", "--quiet")
    log = pt.read("out.csv")
    assert log.u.max() == 6e-3
    assert log.y.max() == 4e-9
    assert log.dt == 0.5


def test_convert_says_what_contradicts_the_file() -> None:
    said = ran("convert", "log.csv", "out.npz", "--unit", "displacement=nm")
    assert "note  column 'displacement_um': unit nm by --unit, um in the file" in said


def test_convert_refuses_before_it_reads() -> None:
    assert "expected an ending" in refusal("convert", "log.csv", "out.xlsx")
    write("out.npz", b"")
    assert "out.npz exists: expected --overwrite" in refusal("convert", "log.csv", "out.npz")
    ran("convert", "log.csv", "out.npz", "--overwrite")
    assert len(pt.read("out.npz")) == 1001
    assert run("convert", "log.csv").exit_code == 2


@pytest.mark.usefixtures("_no_pictures")
def test_other_commands_take_every_format() -> None:
    ran("convert", "log.csv", "log.mat")
    write_model()
    ran("simulate", "dahl.json", "log.mat", "--out", "run")
    assert len(pt.read("run/simulated.csv")) == 1001


def test_missing_readings_are_refused_with_the_option_that_takes_them() -> None:
    lines = log_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("time")) + 1
    for k in range(first + 300, first + 310):
        lines[k] = ",".join([*lines[k].split(",")[:2], ""])
    write("lost.csv", "\n".join(lines) + "\n")
    for command in (("info",), ("identify", "--model", "prandtl-ishlinskii")):
        said = run(command[0], "lost.csv", *command[1:])
        assert "--missing drop" in said.stdout + said.stderr
    assert "10 of 1001" in ran("info", "lost.csv", "--missing", "drop")
    ran("convert", "lost.csv", "dropped.npz", "--missing", "drop")
    ran("convert", "lost.csv", "filled.npz", "--missing", "fill")
    assert np.isnan(pt.read("dropped.npz", missing="drop").recorded).sum() == 10
    assert pt.read("filled.npz").left_out is None
    # A command without the option does not name it.
    assert "--missing" not in refusal("noise", "lost.csv")


def test_a_log_is_decimated_as_in_python() -> None:
    t = np.arange(40_000) / 5000.0
    u = 60.0 * np.sin(2.0 * np.pi * t)
    noise = 1e-8 * np.random.default_rng(1).standard_normal(t.size)
    fast = pt.read(pt.Dataset(u=u, y=1e-6 * u + noise, t=t).save("fast.csv"))
    said = ran("info", "fast.csv")
    assert "250 Hz are enough, --decimate 20" in said
    ran("convert", "fast.csv", "slow.npz", "--decimate", "20")
    slow = pt.read("slow.npz")
    assert slow.dt == pytest.approx(0.004)
    assert np.array_equal(slow.y, fast.decimate(20).y)
    # As `info` advises.
    ran("convert", "fast.csv", "advised.npz", "--decimate", "auto")
    assert np.array_equal(pt.read("advised.npz").y, slow.y)
    assert "--decimate has 'much'" in refusal("convert", "fast.csv", "x.npz", "--decimate", "much")
    # The same log, whole, with a factor of 1.
    ran("convert", "fast.csv", "whole.npz", "--decimate", "1")
    assert len(pt.read("whole.npz")) == 40_000


@pytest.mark.parametrize("factor", ["0", "-3", "999"])
def test_a_factor_that_leaves_nothing_is_refused(factor: str) -> None:
    said = refusal("convert", "log.csv", "out.npz", "--decimate", factor)
    assert f"log.csv: --decimate is {factor}" in said


@pytest.mark.usefixtures("_no_pictures")
def test_identify_and_compare_decimate() -> None:
    kind = ("--model", "prandtl-ishlinskii")
    t = np.arange(1600) / 200.0
    u = (5.0 - 0.4 * t) * np.sin(2.0 * np.pi * t)
    y = 1e-6 * u + 1e-8 * np.random.default_rng(1).standard_normal(t.size)
    pt.Dataset(u=u, y=y, t=t).save("log.csv")
    ran("convert", "log.csv", "half.npz", "--decimate", "2")
    words = ("--decimate", "2", "--json", "--out")
    whole = json.loads(ran("identify", "log.csv", *kind, *words, "one"))
    two = json.loads(ran("identify", "half.npz", *kind, "--json", "--out", "two"))
    assert whole["models"][0]["parameters"] == two["models"][0]["parameters"]
    whole = json.loads(ran("compare", "log.csv", *kind, *words, "three"))
    two = json.loads(ran("compare", "half.npz", *kind, "--json", "--out", "four"))
    for table in (whole, two):
        table.pop("written")
    assert str(whole).replace("log.csv", "half.npz") == str(two)


def test_a_model_is_not_taken_for_a_log() -> None:
    write_model()
    for command in ("info", "identify"):
        assert "dahl.json: is a file that piezotrack wrote" in refusal(command, "dahl.json")


def test_a_window_may_have_its_unit() -> None:
    assert WINDOW.parse("--window", "1s:2500ms") == (1.0, 2.5)
    assert WINDOW.parse("--window", "3:15s") == (3.0, 15.0)
    assert WINDOW.parse("--window", "300:1500ms") == (0.3, 1.5)
    assert WINDOW.parse("--window", "1:") == (1.0, None)
    for wrong in ("1V:2", "s:2", "1e:2"):
        with pytest.raises(pt.ParameterError, match="--window has"):
            WINDOW.parse("--window", wrong)


@pytest.mark.usefixtures("_no_pictures")
def test_a_campaign_takes_all_windows_and_cuts_others() -> None:
    plays = ("--model", "prandtl-ishlinskii", "--plays", "3", "--json", "--out")
    windows = ("--window", "0:2", "--window", "2s:4s")
    for options, folder in ((windows, "two"), (("--every", "2s"), "cut")):
        document = json.loads(ran("campaign", "log.csv", *options, *plays, folder))
        spans = [one["record"] for one in document["results"]]
        assert len(spans) == 2
        assert [span.split(" to ")[0] for span in spans] == ["log.csv 0", "log.csv 2"]
    assert "--every is 9 s" in refusal("campaign", "log.csv", "--every", "9s")


def test_lines_above_the_titles_are_skipped() -> None:
    lines = [line for line in log_text().splitlines() if not line.startswith("#")]
    write("scope.csv", "\n".join(["Maker,model,serial", "made up here", *lines]) + "\n")
    ran("convert", "scope.csv", "plain.npz", "--skip", "2")
    assert np.array_equal(pt.read("plain.npz").y, pt.read("log.csv").y)
    assert "--skip has 'two'" in refusal("info", "scope.csv", "--skip", "two")
    assert "--skip is -1" in refusal("info", "scope.csv", "--skip", "-1")
