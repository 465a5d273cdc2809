"""EPICS on this computer: softioc in one process, ophyd-async and Bluesky in another."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from commands import COMMAND, refusal, write_model

if TYPE_CHECKING:
    from collections.abc import Iterator

PREFIX = "LAB:STAGE"
# In the client: a table, and what is printed at the end comes back as JSON.
CLIENT = """
import asyncio, json
import numpy as np
import piezotrack as pt
volts = 30.0 - 30.0 * np.cos(np.arange(400) / 60.0)
stage = pt.hardware.ophyd_player("LAB:STAGE", name="stage")
async def main():
    await stage.connect()
{body}
    return found
found = {{}}
asyncio.run(main())
print(json.dumps(found))
"""
PLAY = """
    await stage.prepare((volts, 500.0))
    await stage.kickoff()
    await stage.complete()
    read = await stage.read()
    found["record"] = read["stage-record"]["value"].tolist()
    found["table"] = read["stage-table"]["value"].tolist()
    found["held"] = await stage.voltage.get_value()
"""
REFUSED = """
    await stage.voltage.set(10.0)
    try:
        await stage.voltage.set(90.0)
    except Exception as error:
        found["put"] = type(error).__name__
    found["held"] = await stage.voltage.get_value()
    await stage.prepare((np.full(3, 80.0), 500.0))
    await stage.kickoff()
    try:
        await stage.complete()
    except pt.DeviceError as error:
        found["play"] = str(error)
    try:
        await stage.complete()
    except pt.DeviceError as error:
        found["nothing"] = str(error)
"""
HELD = """
    await stage.voltage.set(50.0)
    await asyncio.sleep(1.0)
    found["position"] = await stage.position.get_value()
"""
PLAN = """
import json
import bluesky.plan_stubs as bps
import numpy as np
import piezotrack as pt
from bluesky import RunEngine
from ophyd_async.core import init_devices
engine = RunEngine()
with init_devices():
    stage = pt.hardware.ophyd_player("LAB:STAGE", name="stage")
events = []
def plan():
    yield from bps.open_run()
    yield from bps.prepare(stage, (np.linspace(0.0, 20.0, 50), 500.0), wait=True)
    yield from bps.kickoff(stage, wait=True)
    yield from bps.complete(stage, wait=True)
    yield from bps.trigger_and_read([stage])
    yield from bps.close_run()
engine(plan(), lambda name, doc: events.append((name, doc)))
(event,) = [doc for name, doc in events if name == "event"]
print(json.dumps(np.asarray(event["data"]["stage-record"]).tolist()))
"""


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as tcp:
        tcp.bind(("127.0.0.1", 0))
        return int(tcp.getsockname()[1])


def environment() -> dict[str, str]:
    """Return an environment in which server and clients find each other, on ports of their own."""
    port = str(free_port())
    paths = os.pathsep.join(
        filter(None, [str(Path(pt.__file__).parents[1]), os.environ.get("PYTHONPATH")])
    )
    return {
        **os.environ,
        "EPICS_CA_SERVER_PORT": port,
        "EPICS_CA_REPEATER_PORT": str(free_port()),
        "EPICS_CA_ADDR_LIST": "127.0.0.1",
        "EPICS_CA_AUTO_ADDR_LIST": "NO",
        "PYTHONPATH": paths,
    }


@pytest.fixture(scope="module")
def surroundings() -> Iterator[dict[str, str]]:
    """Serve the virtual stage in a process of its own: the environment in which it is found."""
    here = environment()
    with serving(here, PREFIX) as (_, line):
        assert line.endswith(":Message of virtual amplifier, 0 to 75 V")
        yield here


@contextmanager
def serving(
    here: dict[str, str], prefix: str, *options: str
) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """`piezotrack serve epics` in a process of its own, and the line in which it says what."""
    command = [*COMMAND, "serve", "epics", "--prefix", prefix, *options]
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, **pipes, text=True, env=here) as child:
        try:
            assert child.stdout is not None
            # The banner of EPICS comes before.
            line = next((one for one in child.stdout if one.startswith("serving ")), "")
            assert line.startswith(f"serving {prefix}:Voltage, {prefix}:Position, "), line
            yield child, line.rstrip("\n")
        finally:
            child.kill()


def ask(program: str, surroundings: dict[str, str]) -> Any:
    command = [sys.executable, "-c", program]
    done = subprocess.run(
        command, env=surroundings, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_prepare_kickoff_complete_are_a_play(surroundings: dict[str, str]) -> None:
    answer = ask(CLIENT.format(body=PLAY), surroundings)
    volts = 30.0 - 30.0 * np.cos(np.arange(400) / 60.0)
    alone = pt.hardware.connect("virtual:").play(volts, 500.0)
    np.testing.assert_array_equal(answer["table"], volts)
    # What differs is the sensor's noise: the server has read the stage at rest before.
    np.testing.assert_allclose(answer["record"], 1e6 * alone.displacement, atol=1.0)
    assert np.ptp(answer["record"]) > 50.0
    assert answer["held"] == volts[-1]


def test_what_is_refused_is_said_and_puts_nothing_out(surroundings: dict[str, str]) -> None:
    answer = ask(CLIENT.format(body=REFUSED), surroundings)
    assert answer["held"] == 10.0
    assert "stage: Table is 80 V at sample 0: expected 0 to 75 V" in answer["play"]
    assert "expected kickoff before complete" in answer["nothing"]


def test_a_voltage_moves_the_position(surroundings: dict[str, str]) -> None:
    found = ask(CLIENT.format(body=HELD), surroundings)
    assert 40.0 < found["position"] < 110.0


def test_a_plan_of_bluesky_flies_it(surroundings: dict[str, str]) -> None:
    record = ask(PLAN, surroundings)
    assert len(record) == 50
    assert np.all(np.isfinite(record))


def test_without_the_packages_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    device = pt.hardware.connect("virtual:")
    monkeypatch.setitem(sys.modules, "softioc.builder", None)
    monkeypatch.setitem(sys.modules, "ophyd_async.epics.core", None)
    with pytest.raises(pt.DeviceError, match=r"softioc, .*piezotrack\[epics\]"):
        pt.hardware.serve_epics(device, PREFIX)
    with pytest.raises(pt.DeviceError, match=r"ophyd_async, .*piezotrack\[epics\]"):
        pt.hardware.ophyd_player(PREFIX)


@pytest.mark.parametrize("prefix", ["", "LAB STAGE", "Bühne", 3])
def test_prefixes_that_are_refused(prefix: Any) -> None:
    with pytest.raises(pt.ParameterError, match="expected the start of names"):
        pt.hardware.serve_epics(pt.hardware.connect("virtual:"), prefix)


def test_a_prefix_whose_names_epics_cannot_hold_is_refused() -> None:
    # :Position and :Message.. have nine letters at most, names sixty.
    said = refusal("serve", "epics", "--prefix", "A" * 52)
    assert said.startswith("--prefix is 'AAAA")
    assert "52 letters: expected 51 at most" in said


@pytest.mark.slow
def test_the_longest_prefix_is_served() -> None:
    with serving(environment(), "A" * 51) as (_, line):
        assert f"{'A' * 51}:Position" in line


FAILING = """
import asyncio, json, sys
import aioca
async def alarms():
    return {one: (await aioca.caget("A:B:" + one, format=aioca.FORMAT_TIME)).severity
            for one in ("Voltage", "Position")}
async def main():
    await aioca.caput("A:B:Voltage", 20.0, wait=True)
    await asyncio.sleep(1.0)
    found = {"before": await alarms()}
    print("ready", flush=True)
    sys.stdin.readline()
    await asyncio.sleep(1.5)
    async def message():
        return (await aioca.caget("A:B:Message", datatype=aioca.DBR_CHAR_STR))
    found["first"] = await message()
    await aioca.caput("A:B:Voltage", 55.0, wait=True, timeout=20.0, throw=False)
    found |= {"after": await alarms(), "voltage": await aioca.caget("A:B:Voltage"),
              "message": await message()}
    return found
found = asyncio.run(main())
print(json.dumps(found))
"""


@pytest.mark.slow
def test_a_device_that_fails_is_an_alarm_with_its_first_sentence() -> None:
    here = environment()
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    server = pt.hardware.GcsServer(pt.VirtualStage.xu_li_2010(seed=1), limits=(0.0, 75.0))
    with server, serving(here, "A:B", "--device", server.address):
        command = [sys.executable, "-c", FAILING]
        with subprocess.Popen(command, **pipes, text=True, env=here) as client:
            assert client.stdout is not None
            assert client.stdout.readline() == "ready\n"
            server.close()
            said, _ = client.communicate("\n", timeout=120)
    answer = json.loads(said.splitlines()[-1])
    assert answer["before"] == {"Voltage": 0, "Position": 0}
    assert answer["after"] == {"Voltage": 3, "Position": 3}
    assert answer["voltage"] == 20.0
    assert answer["first"]
    assert answer["message"] == answer["first"]


ASKED = """
import asyncio, json
import piezotrack as pt
stage = pt.hardware.ophyd_player("A:B", name="stage")
async def main():
    await stage.connect()
    await stage.voltage.set(61.0)
    return await stage.voltage.get_value()
print(json.dumps(asyncio.run(main())))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C in another way")
@pytest.mark.parametrize(
    ("number", "code", "word"),
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")],
)
def test_a_model_is_served_within_its_limits_until_a_signal(
    number: signal.Signals,
    code: int,
    word: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    write_model()
    here = environment()
    options = ("dahl.json", "--limits", "0:62", "--speed", "10")
    with serving(here, "A:B", *options) as (child, line):
        assert line.endswith(", 0 to 62 V")
        assert ask(ASKED, here) == 61.0
        child.send_signal(number)
        assert child.wait(60.0) == code
        assert child.stderr is not None
        assert child.stderr.read().splitlines()[-1] == f"piezotrack: {word}"


@pytest.mark.slow
def test_a_device_is_published_in_the_place_of_the_virtual_stage() -> None:
    here = environment()
    with (
        pt.hardware.GcsServer(pt.VirtualStage.xu_li_2010(seed=1), limits=(0.0, 62.0)) as server,
        serving(here, "A:B", "--device", server.address) as (_, line),
    ):
        assert line.endswith(f" of {server.address} output 1, 0 to 62 V")
        assert ask(ASKED, here) == 61.0
        there = pt.hardware.GcsDevice("127.0.0.1", server.port)
        assert there.voltage == 61.0
        there.close()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("epics", "--prefix is missing: expected the start of names, as LAB:STAGE"),
        ("epics --prefix", "--prefix is '': expected the start of names, as LAB:STAGE"),
        ("epics --prefix A --port 5064", "--port has no effect with epics, which listens where"),
        ("epics --prefix A --host 127.0.0.1", "--host has no effect with epics"),
        ("epics --prefix A --device virtual: --speed 2", "--speed has no effect with --device"),
        ("epics --prefix A --device virtual: --limits 0:9", "--limits has no effect with --dev"),
        ("epics --prefix A --device virtual: m.json", "MODEL has no effect with --device"),
        ("epics --prefix A --device usb:1", "--device is 'usb:1': expected an address"),
        ("epics gone.json --prefix A", "gone.json: there is no such file"),
        ("epics --prefix A --limits 75:0", "--limits is 75 to 0 V: expected the lower one first"),
        ("epics --prefix A --speed 0", "--speed is 0: expected"),
        ("gcs --prefix A", "--prefix has no effect with gcs: expected it left out"),
        ("scpi --prefix A", "--prefix has no effect with scpi: expected it left out"),
        ("scpi --device virtual:", "--device has no effect with scpi: expected it left out"),
    ],
)
def test_what_cannot_be_served_is_refused_by_name(options: str, words: str) -> None:
    given = options.split()
    if given[-1] == "--prefix":
        given.append("")
    assert refusal("serve", *given).startswith(words)


def test_the_command_names_the_extra_where_softioc_is_not_installed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "softioc.builder", None)
    said = refusal("serve", "epics", "--prefix", "A")
    assert said == (
        "serving EPICS needs softioc, which is not installed: expected pip install "
        "'piezotrack[epics]'"
    )


def bound_by(process: int) -> set[tuple[str, str, int]]:
    """The sockets that a process of Linux has bound: kind, address, port."""
    folder = Path("/proc", str(process))
    links = []
    for one in (folder / "fd").iterdir():
        with suppress(OSError):
            links.append(str(one.readlink()))
    addresses = set()
    for kind in ("tcp", "udp", "tcp6", "udp6"):
        for line in (folder / "net" / kind).read_text().splitlines()[1:]:
            words = line.split()
            address, port = words[1].split(":")
            # Of TCP those that listen.
            if f"socket:[{words[9]}]" in links and (kind[:3] == "udp" or words[3] == "0A"):
                host = ".".join(str(one) for one in reversed(bytes.fromhex(address)))
                addresses.add((kind, host, int(port, 16)))
    return addresses


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize(
    "given",
    [
        {},
        {"EPICS_CAS_AUTO_BEACON_ADDR_LIST": "NO"},
        {"EPICS_CAS_BEACON_ADDR_LIST": "127.0.0.1", "EPICS_CAS_INTF_ADDR_LIST": " "},
    ],
)
def test_it_listens_on_this_computer_only_whatever_else_is_said(given: dict[str, str]) -> None:
    here = environment()
    # Where the beacons go says nothing on who may connect.
    here = {name: value for name, value in here.items() if not name.startswith("EPICS_CAS_")}
    with serving({**here, **given}, PREFIX) as (child, _):
        bound = bound_by(child.pid)
    port = int(here["EPICS_CA_SERVER_PORT"])
    assert ("tcp", "127.0.0.1", port) in bound
    assert {host for _, host, number in bound if number == port} == {"127.0.0.1"}


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_it_listens_where_it_is_told_to() -> None:
    here = {**environment(), "EPICS_CAS_INTF_ADDR_LIST": "0.0.0.0"}
    with serving(here, PREFIX) as (child, _):
        bound = bound_by(child.pid)
    assert ("tcp", "0.0.0.0", int(here["EPICS_CA_SERVER_PORT"])) in bound
