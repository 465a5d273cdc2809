"""The steps of the page: what they compute is what commands and scripts compute."""

from __future__ import annotations

import io
import shlex
import time
import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from commands import ran
from page.window import Window
from piezotrack.app.parts import unpacked
from piezotrack.app.steps import PAGES, model
from piezotrack.app.steps.closed_loop import controller_of, range_of, reach_of, run_of
from piezotrack.app.steps.motion import controllers
from piezotrack.stages.registry import MODELS

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> Iterator[Window]:
    kinds = tuple(one for one in MODELS if one.name in ("dahl", "duhem"))
    monkeypatch.setattr(model, "MODELS", kinds)
    made = Window()
    yield made
    made.session.close()


def opened(window: Window, log: pt.Dataset, folder: Path, name: str = "stage.csv") -> None:
    content = log.save(folder / name).read_bytes()
    window.do("open", purpose="log", name=name, content=content)


def test_the_files_are_those_of_the_commands(
    window: Window, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window.do("log.example")
    window.do("go", to="model")
    window.finish()
    window.set("model", chosen="dahl")
    window.do("go", to="loop")
    window.finish()
    window.do("go", to="use")
    files = dict(window.take(f"use.{one}") for one in ("model", "controller", "export", "table"))

    monkeypatch.chdir(tmp_path)
    pt.datasets.dbo_training().save("training.csv")
    pt.datasets.dbo_tracking().save("tracking.csv")
    for line in PAGES["use"].commands(window.desk) + PAGES["motion"].commands(window.desk):
        ran(*shlex.split(line)[1:])
    assert Path("results/dahl.json").read_bytes() == files["dahl.json"]
    assert Path("tuned/controller.json").read_bytes() == files["controller.json"]
    assert Path("voltage/feedforward.csv").read_bytes() == files["feedforward.csv"]
    with zipfile.ZipFile(io.BytesIO(files["controller.zip"])) as archive:
        assert len(archive.namelist()) == 4
        for name in archive.namelist():
            assert Path("firmware", name).read_bytes() == archive.read(name)


def test_the_script_makes_the_same_controller(
    window: Window, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window.do("log.example")
    window.set("model", test="", test_from=0.0)
    window.do("go", to="model")
    window.finish()
    window.set("model", chosen="dahl")
    window.do("go", to="loop")
    window.finish()
    window.set("loop", kp=2e4)
    files = dict(window.take(f"use.{one}") for one in ("model", "controller", "script"))
    monkeypatch.chdir(tmp_path)
    pt.datasets.dbo_training().save("training.csv")
    script = Path("steps.py")
    script.write_bytes(files["piezotrack_steps.py"])
    exec(compile(script.read_text(), "steps.py", "exec"), {})
    assert Path("dahl.json").read_bytes() == files["dahl.json"]
    made, kept = pt.load_controller("controller.json"), tmp_path / "page.json"
    kept.write_bytes(files["controller.json"])
    assert made.feedback == pt.load_controller(kept).feedback
    assert isinstance(made.feedback, pt.Pid)
    assert made.feedback.kp == 2e4


def test_the_tuned_loop_follows_better_than_the_inverse_and_that_than_none(window: Window) -> None:
    window.do("log.example")
    window.do("go", to="model")
    window.finish()
    window.do("go", to="motion")
    runs = {name: run_of(window.desk, one) for name, one in controllers(window.desk).items()}
    rms = {name: run.score(true=True).rms_error for name, run in runs.items()}
    assert rms["loop"] < rms["inverse"] < 0.2 * rms["without"]
    low, high = range_of(window.desk)
    reach = reach_of(window.desk)
    assert reach.low < low < high < reach.high


def test_faster_is_more_bandwidth_and_robust_is_less_sensitivity(window: Window) -> None:
    window.do("log.example")
    window.do("go", to="model")
    window.finish()
    found = {}
    for speed, robustness in ((0.1, 0.5), (0.9, 0.5), (0.9, 1.0)):
        window.set("loop", speed=speed, robustness=robustness)
        window.do("go", to="loop")
        window.finish()
        report = pt.check_loop(
            pt.VirtualStage.of(model.fit_of(window.desk)), controller_of(window.desk)
        )
        found[speed, robustness] = report
    slow, fast, robust = found.values()
    assert (slow.middle.bandwidth or 0.0) < 0.7 * (fast.middle.bandwidth or 0.0)
    assert max(one.sensitivity for _, one in robust.cases) < 1.16
    assert max(one.sensitivity for _, one in fast.cases) > 1.16


def test_what_a_record_determines_is_a_light(window: Window, tmp_path: Path) -> None:
    t = np.arange(4000) / 200.0
    grows = (10.0 + 2.0 * t) * (1.0 - np.cos(2.0 * np.pi * t))
    opened(window, pt.Dataset(u=grows, y=1e-6 * grows, t=t), tmp_path)
    window.do("whole")
    lights = {one["name"]: one["light"] for one in window.parts["log.determines"]["items"]}
    assert lights["Loop"] == "green"
    assert lights["Rate or lag"] == "red"
    assert lights["Creep"] == "red"
    assert lights["Small loops"] in ("green", "amber")


def test_a_column_without_a_unit_is_red_and_a_button_mends_it(
    window: Window,
) -> None:
    t = np.arange(2000) / 200.0
    u = 30.0 - 30.0 * np.cos(2.0 * np.pi * t)
    rows = "\n".join(f"{a:.6g},{b:.6g},{c:.9g}" for a, b, c in zip(t, u, u * 1.0, strict=True))
    window.do("open", purpose="log", name="bare.csv", content=f"time_s,u,y_um\n{rows}\n".encode())
    window.do("whole")
    rail = window.answers[-1][0]["rail"][0]
    assert rail["light"] == "red"
    # In the words of the page: a person has no arguments to give.
    (fault,) = window.parts["log.fault"]["items"]
    assert fault["text"] == "choose the column of the drive above"
    window.set("log", drive="u")
    (fault,) = window.parts["log.fault"]["items"]
    assert fault["text"] == "choose the unit of the drive above"
    assert [fix["label"] for fix in fault["fixes"]] == ["u is V", "u is mV", "u is kV"]
    window.set("log", drive="u", **{"units.u": "V"})
    window.do("whole")
    assert window.answers[-1][0]["rail"][0]["light"] == "green"
    assert "units={'u': 'V'}" in window.parts["log.code"]["text"]


def test_noise_is_no_log(window: Window) -> None:
    draws = np.random.default_rng(1)
    window.do("open", purpose="log", name="noise.csv", content=draws.bytes(5000))
    answer, _ = window.do("whole")
    assert answer["rail"][0]["light"] == "red"
    (fault,) = window.parts["log.fault"]["items"]
    assert fault["level"] == "red"
    assert fault["text"]
    # The way on is there, and no other step repeats the sentence.
    assert {"log.open", "log.example"} <= set(answer["order"])
    assert fault["text"] not in [one["text"] for one in answer["rail"][1:]]
    window.do("log.example")
    assert window.do("whole")[0]["rail"][0]["light"] == "green"


def test_stop_ends_the_fits_and_keeps_what_is_done(window: Window) -> None:
    window.do("log.example")
    window.do("go", to="model")
    window.do("stop")
    until = time.monotonic() + 20.0
    while not window.desk.jobs["models"].done:
        assert time.monotonic() < until
        time.sleep(0.02)
    assert len(model.trials_of(window.desk).done) < 2


def test_a_state_is_the_same_page_again(window: Window) -> None:
    window.do("log.example")
    window.set("log", window=[4.0, 12.5])
    name, content = window.take("use.state")
    assert name.endswith(".piezotrack.json")
    before = window.desk.state
    window.set("log", window=None)
    window.do("open", purpose="state", name=name, content=content)
    assert window.desk.state == before
    window.do("undo")
    assert window.desk.state.log.window is None


def test_a_state_holds_for_the_log_that_is_opened_for_it(window: Window, tmp_path: Path) -> None:
    log = pt.datasets.dbo_training()[3.0:13.0]
    opened(window, log, tmp_path)
    window.set("log", window=[4.0, 12.5])
    window.set("motion", low=-110e-6, frequency=2.0)
    before = window.desk.state
    other = Window()
    other.do("link", text=before.link())
    assert "is not open" in other.parts["log.fault"]["items"][0]["text"]
    opened(other, log, tmp_path)
    assert other.desk.state == before
    # Another record under the name that is open begins anew.
    opened(other, log, tmp_path)
    assert other.desk.state.motion.low is None
    other.session.close()


def test_an_unstable_loop_is_not_exported(window: Window) -> None:
    window.do("log.example")
    window.do("go", to="model")
    window.finish()
    window.set("loop", ki=4e8)
    window.do("go", to="use")
    answer, _ = window.do("whole")
    lights = {one["step"]: one["light"] for one in answer["rail"]}
    assert lights["loop"] == lights["use"] == "red"
    for name in ("use.export", "use.controller"):
        answer, content = window.do(name)
        assert content is None
        assert "unstable" in answer["error"]["text"]


def test_a_motion_beyond_the_reach_is_said_beside_its_files(window: Window) -> None:
    window.do("log.example")
    window.do("go", to="model")
    window.finish()
    window.do("go", to="use")
    assert "use.warnings" not in window.do("whole")[0]["order"]
    window.set("motion", high=100e-6)
    (warning,) = window.parts["use.warnings"]["items"]
    assert "held at its limit" in warning["text"]
    _, table = window.take("use.table")
    volts = np.loadtxt(table.decode().splitlines(), delimiter=",", skiprows=1)[:, 1]
    assert volts.max() == pytest.approx(3.6)
    window.do("motion.whole")
    assert "use.warnings" not in window.do("whole")[0]["order"]


def test_the_reach_is_waived_where_the_motion_is_beyond_it_alone(
    window: Window, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    window.do("log.example")
    window.do("go", to="model")
    window.finish()
    window.set("loop", kp=1e4)
    name, content = window.take("use.model")
    Path("results").mkdir()
    Path("results", name).write_bytes(content)
    commands = {"motion": "feedforward", "loop": "track", "use": "export"}
    for high, beyond in ((None, False), (100e-6, True)):
        window.set("motion", high=high)
        for step, name in commands.items():
            lines = PAGES[step].commands(window.desk)
            (line,) = (one for one in lines if one.split()[1] == name)
            assert ("--beyond-reach" in line) is beyond
            if step != "use":
                ran(*shlex.split(line)[1:], "--overwrite")
        assert ("beyond_reach=True" in "\n".join(PAGES["use"].python(window.desk))) is beyond


def test_the_window_of_the_test_ends_without_the_last_bits_of_a_sum(
    window: Window, tmp_path: Path
) -> None:
    opened(window, pt.datasets.dbo_training(), tmp_path)
    end = model.model_options(window.desk, "duhem")["test_window"].partition(":")[2]
    assert end == "40.135"


def test_what_is_unusual_has_a_place_and_a_button(window: Window, tmp_path: Path) -> None:
    t = np.arange(4000) / 200.0
    u = 30.0 - 30.0 * np.cos(2.0 * np.pi * t / 2.0)
    y = 5e-7 * u + np.where(t > 13.0, 2e-6, 0.0)
    opened(window, pt.Dataset(u=u, y=y, t=t), tmp_path)
    window.do("whole")
    (flag,) = (one for one in window.parts["log.flags"]["items"] if one["fixes"])
    assert "jumps" in flag["text"]
    (region,) = window.parts["log.y"]["regions"]
    assert (region["from"], region["to"]) == pytest.approx((13.0, 13.005))
    (fix,) = flag["fixes"]
    window.do(fix["do"], step=fix["step"], values=fix["values"])
    assert window.desk.state.log.window == pytest.approx((0.0, 13.0))
    assert not any("jumps" in one["text"] for one in window.parts["log.flags"]["items"])


def test_hum_is_marked_in_a_spectrum(window: Window, tmp_path: Path) -> None:
    t = np.arange(8000) / 1000.0
    u = 30.0 - 30.0 * np.cos(2.0 * np.pi * t)
    noise = np.random.default_rng(1).normal(0.0, 5e-9, t.size)
    for hum in (0.0, 40e-9):
        y = 5e-7 * u + noise + hum * np.sin(2.0 * np.pi * 50.02 * t)
        opened(window, pt.Dataset(u=u, y=y, dt=1e-3), tmp_path, f"hum{hum}.csv")
        page = window.do("whole")[0]["changed"]
        assert ("log.hum" in page) == bool(hum)
    (mark,) = page["log.hum"]["regions"]
    assert 0.5 * (mark["from"] + mark["to"]) == pytest.approx(50.0, abs=0.2)
    amplitudes = unpacked(page["log.hum"]["lines"][0]["y"])
    assert amplitudes.max() == pytest.approx(40.0, rel=0.1)


def test_swapped_columns_are_exchanged_by_a_button(window: Window, tmp_path: Path) -> None:
    t = np.arange(4000) / 200.0
    log = pt.VirtualStage.xu_li_2010(seed=1).record(30.0 - 30.0 * np.cos(np.pi * t), 0.005)
    opened(window, log, tmp_path)
    window.set("log", drive="displacement_m", displacement="voltage_V")
    window.set("log", **{"units.displacement_m": "V", "units.voltage_V": "um"})
    window.do("whole")
    (fix,) = (
        fix
        for one in window.parts["log.flags"]["items"]
        for fix in one["fixes"]
        if "swap" in fix["label"]
    )
    window.do(fix["do"], step=fix["step"], values=fix["values"])
    assert window.desk.state.log.drive == "voltage_V"
    assert window.desk.state.log.displacement == "displacement_m"


@pytest.mark.parametrize(("width", "form"), [(85, "pdf"), (170, "svg"), (85, "png")])
def test_every_chart_is_a_picture(window: Window, width: int, form: str) -> None:
    window.do("log.example")
    window.set("use", width=width, picture=form)
    for name in ("drive", "y", "loop"):
        answer, content = window.do("picture", chart=name)
        assert answer["error"] is None
        assert answer["download"] == f"{name}.{form}"
        assert content is not None
        assert content.startswith({"pdf": b"%PDF", "svg": b"<?xml", "png": b"\x89PNG"}[form])
    refused = window.do("picture", chart="nothing")[0]["error"]
    assert "one of drive, y, loop" in refused["text"]


def test_the_line_of_a_search_does_not_run_back_to_the_next(window: Window) -> None:
    window.do("log.example")
    trial = model.trials_of(window.desk).rows["dahl"]
    trial.course = [(35, 4e-6), (900, 1e-6), (35, 5e-6), (400, 2e-6)]
    count, error = model._columns(trial, 1e6)
    assert not (np.diff(count) < 0).any()
    np.testing.assert_allclose(error, [4.0, 1.0, np.nan, 5.0, 2.0])
