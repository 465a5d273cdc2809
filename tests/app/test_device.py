"""The device of the page: moved slowly first, recorded, learnt on, and led to rest by STOP."""

from __future__ import annotations

import json
import operator
import os
import signal
import subprocess
import sys
import threading
import time
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from page.interrupted import interruptions
from page.server import Served
from page.window import Window
from piezotrack.app.device import DeviceProcess
from piezotrack.app.steps import model
from piezotrack.app.steps.device import _measured
from piezotrack.stages.registry import MODELS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


@pytest.fixture(scope="module")
def device() -> Iterator[DeviceProcess]:
    made = DeviceProcess("virtual:")
    yield made
    made.close()


@pytest.fixture
def slow() -> Iterator[pt.hardware.GcsServer]:
    """Return a stage that moves in real time."""
    with pt.hardware.GcsServer(pt.VirtualStage.xu_li_2010(seed=1)) as server:
        yield server


def test_from_a_record_to_a_learnt_table(
    device: DeviceProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = tuple(one for one in MODELS if one.name == "prandtl-ishlinskii")
    monkeypatch.setattr(model, "MODELS", kinds)
    window = Window(device)
    desk = window.desk
    window.set("device", low=5.0, high=65.0, rate=500.0)
    refused = window.do("log.record")[0]["error"]
    assert "slow stroke" in refused["text"]
    window.do("log.stroke")
    window.finish()
    assert device.stroked == (5.0, 65.0)
    stroke = desk.on_device["stroke"]
    assert stroke.duration == pytest.approx(10.0)
    assert (stroke.u.min(), stroke.u.max()) == pytest.approx((5.0, 65.0), abs=0.1)

    window.do("log.record")
    window.finish()
    until = time.monotonic() + 20.0
    while not desk.state.log.source and time.monotonic() < until:
        time.sleep(0.02)
    window.do("whole")
    assert desk.state.log.source == "measured.csv"
    assert desk.state.log.hold == "zoh"
    window.do("go", to="model")
    window.finish()
    window.set("motion", kind="triangle", frequency=2.0, low=20e-6, high=80e-6)
    window.do("go", to="use")
    window.set("device", trials=6)
    window.do("use.learn")
    window.finish()
    assert not desk.faults("device")
    errors = np.array([rms for rms, _ in desk.on_device["errors"]])
    assert errors.size <= 6
    assert errors.min() < 0.2 * errors[0]
    name, content = window.take("use.learnt")
    assert name == "learnt.csv"
    volts = np.loadtxt(content.decode().splitlines(), delimiter=",", skiprows=1)[:, 2]
    assert volts.min() >= 5.0
    assert volts.max() <= 65.0

    window.do("use.play")
    window.finish()
    name, _ = window.take("use.run")
    assert name == "tracking.csv"
    run = desk.on_device["run"]
    assert run.score().rms_error == pytest.approx(errors[0], rel=0.2)
    window.session.close()


def test_the_first_stroke_is_slow_from_rest_on(device: DeviceProcess) -> None:
    window = Window(device)
    window.set("device", low=30.0, high=60.0)
    window.do("log.stroke")
    window.finish()
    whole = window.desk.on_device["stroke"].full
    assert whole.u[0] == 0.0
    # 30 V in 2.5 s, smoothly; half a second would take 112 V/s.
    assert np.abs(np.diff(whole.u)).max() / whole.dt < 25.0
    window.session.close()


def test_another_window_sees_the_device_at_rest_again(device: DeviceProcess) -> None:
    first, second = Window(device), Window(device)
    first.do("log.stroke")
    answer, _ = second.do("whole")
    assert "log.moving" in answer["order"]
    first.finish()
    until = time.monotonic() + 20.0
    while "log.moving" in second.answers[-1][0]["order"]:
        assert time.monotonic() < until
        time.sleep(0.05)
    first.session.close()
    second.session.close()


@pytest.mark.parametrize(
    ("values", "named"), [({"low": -1.0}, "low"), ({"high": 75.1}, "high"), ({"low": 70.0}, "high")]
)
def test_limits_beyond_those_of_the_device_are_refused(
    device: DeviceProcess, values: dict[str, float], named: str
) -> None:
    window = Window(device)
    window.set("device", **({"high": 60.0} | values))
    for do in ("log.stroke", "log.record"):
        error = window.do(do)[0]["error"]
        assert error["control"] == named
        assert "0 to 75 V" in error["text"]
    assert not device.busy
    window.session.close()


def test_an_address_without_a_device_is_refused() -> None:
    with pytest.raises(pt.ParameterError, match=r"nothing:"):
        DeviceProcess("nothing:")
    with pytest.raises(pt.DeviceError, match=r"127\.0\.0\.1"):
        DeviceProcess("gcs://127.0.0.1:1")


def test_after_work_that_fails_the_device_is_there_for_the_next(device: DeviceProcess) -> None:
    # Each gets the device and a function; the first takes one thing only.
    with pytest.raises(pt.DeviceError, match="TypeError"):
        device.run(operator.not_)  # type: ignore[arg-type]
    assert not device.busy
    assert device.run(operator.is_not)


def test_the_end_of_the_process_of_a_device_is_said_each_time(
    slow: pt.hardware.GcsServer,
) -> None:
    device = DeviceProcess(slow.address)
    killed = threading.Timer(0.5, device._process.kill)
    work = partial(_measured, drive="triangle:0.1Hz,5..65V,10s", rate=100.0, ramp=0.1)
    killed.start()
    for _ in range(2):
        with pytest.raises(pt.DeviceError, match="has ended"):
            device.run(work)
        assert not device.busy
    # Nothing is left to be told or ended.
    device.stop()
    device.close()


def reached(other: Any, there: Callable[[float], bool], within: float) -> None:
    """Wait until the voltage at the output is there."""
    until = time.monotonic() + within
    while not there(other.voltage):
        assert time.monotonic() < until
        time.sleep(0.02)


def moving(window: Window, address: str) -> Any:
    """Begin the slow stroke, and return a second connection when it is well above rest."""
    other = pt.hardware.connect(address)
    window.do("log.stroke")
    reached(other, lambda volts: volts > 10.0, within=10.0)
    return other


def test_the_way_to_rest_is_not_hurried() -> None:
    """A second interruption would end the way to rest in one step."""
    device = DeviceProcess("virtual:")
    told: list[object] = []

    def again() -> bool:
        device.stop()
        return bool(told)

    assert device.run(interruptions, told.append, again) == 1
    assert device.run(interruptions, told.append, again) == 1
    if hasattr(os, "getpgid"):
        # Ctrl-C in a terminal goes to the group of the program.
        assert os.getpgid(device._process.pid or 0) != os.getpgid(0)
    device.close()


def test_stop_leads_to_rest(slow: pt.hardware.GcsServer) -> None:
    device = DeviceProcess(slow.address)
    window, second = Window(device), Window(device)
    other = moving(window, slow.address)
    refused = second.do("log.stroke")[0]["error"]
    assert "in use" in refused["text"]
    begun = time.monotonic()
    device.stop()
    window.finish()
    assert time.monotonic() - begun < 3.0
    assert other.voltage == pytest.approx(0.0, abs=0.01)
    assert device.stroked is None
    assert window.desk.faults("device")
    # The same connection moves again.
    moving(window, slow.address).close()
    device.close()
    assert other.voltage == pytest.approx(0.0, abs=0.01)
    other.close()
    window.session.close()
    second.session.close()


@pytest.mark.slow
@pytest.mark.parametrize("by", ["halt", "close"])
def test_the_last_window_leaves_the_output_at_rest(slow: pt.hardware.GcsServer, by: str) -> None:
    served = Served(device=slow.address)
    socket = served.enter()
    assert socket.answer()["device"] is True
    other = pt.hardware.connect(slow.address)
    socket.send(json.dumps({"do": "log.stroke"}))
    reached(other, lambda volts: volts > 10.0, within=10.0)
    if by == "halt":
        socket.send(json.dumps({"do": "halt"}))
    else:
        socket.end()
    reached(other, lambda volts: abs(volts) < 0.01, within=2.0 if by == "halt" else 8.0)
    other.close()
    if by == "halt":
        socket.end()


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="there is no SIGKILL")
def test_a_killed_program_leaves_the_output_at_rest(slow: pt.hardware.GcsServer) -> None:
    lines = (
        "import functools, sys",
        "from piezotrack.app.device import DeviceProcess",
        "from piezotrack.app.steps.device import _measured",
        "drive = functools.partial(_measured, drive='triangle:0.1Hz,0..60V,10s', rate=200.0)",
        "DeviceProcess(sys.argv[1]).run(drive)",
    )
    other = pt.hardware.connect(slow.address)
    with subprocess.Popen([sys.executable, "-c", "\n".join(lines), slow.address]) as program:
        reached(other, lambda volts: volts > 10.0, within=20.0)
        program.kill()
    reached(other, lambda volts: abs(volts) < 0.01, within=3.0)
    other.close()
