"""``piezotrack serve``: a controller of one's own, until it is stopped."""

from __future__ import annotations

import os
import signal
from typing import TYPE_CHECKING

import pytest

import piezotrack as pt
from commands import refusal, write_model
from gcs_peers import quiet_stage
from piezotrack.hardware import GcsServer
from served import serving

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C in another way")
@pytest.mark.parametrize(
    ("number", "code", "word"),
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")],
)
def test_it_serves_until_a_signal_ends_it(number: signal.Signals, code: int, word: str) -> None:
    with serving("--speed", "100") as (process, address, rest):
        assert rest == "0 to 75 V"
        device = pt.hardware.connect(address)
        log = pt.measure(device, "sine:1Hz,0..75V,2s", rate=500.0)
        # The stage of the paper: 75 V end at 117.76 um.
        assert log.stroke == pytest.approx(117.76e-6, rel=0.02)
        process.send_signal(number)
        assert process.wait(60.0) == code
        with pytest.raises(pt.DeviceError, match=r"connection|cannot be sent"):
            device.hold(1.0)
        device.close()
        assert process.communicate() == ("", f"piezotrack: {word}\n")


def test_it_serves_a_model_file() -> None:
    log = pt.VirtualStage.xu_li_2010(seed=1).record(
        pt.hardware.parse_drive("decaying:1Hz,0..60V").sample(2e-3), 2e-3, hold="zoh"
    )
    pt.identify(log, "prandtl-ishlinskii").save("model.json")
    with serving("model.json") as (_, address, rest):
        assert rest == "0 to 60 V"
        device = pt.hardware.connect(address)
        assert device.limits == (0.0, 60.0)
        device.close()
    with serving("model.json", "--limits", "10:40") as (_, _, rest):
        assert rest == "10 to 40 V"


def test_it_serves_scpi_at_an_address_that_connects() -> None:
    with serving("--limits", "0:60", protocol="scpi") as (_, address, rest):
        assert rest == "0 to 60 V"
        device = pt.hardware.connect(address)
        assert device.limits == (0.0, 60.0)
        assert isinstance(device, pt.hardware.Exchanging)
        assert abs(device.exchange(0.0)) < 1e-6
        device.close()
    assert refusal("serve", "scpi", "--speed", "0").startswith("--speed is 0: expected")
    assert refusal("serve", "scpi", "--port", "70000").startswith("--port is 70000: expected 0 to")


def test_what_cannot_be_served_is_refused() -> None:
    write_model()
    assert refusal("serve", "gcs", "none.json").startswith("none.json: there is no such file")
    # It was never identified from a record.
    message = refusal("serve", "gcs", "dahl.json")
    assert message.startswith("--limits is not given, and dahl.json does not say")
    for limits in ("75:0", "0:0", "0:inf", "nan:1"):
        assert refusal("serve", "gcs", "--limits", limits).startswith("--limits ")
    assert refusal("serve", "gcs", "--limits", "75").startswith("--limits is '75'")
    assert refusal("serve", "gcs", "--port", "70000").startswith("--port is 70000: expected 0 to")
    for speed in ("0", "nan", "-1", "20000"):
        assert refusal("serve", "gcs", "--speed", speed).startswith(f"--speed is {speed}: expected")
    assert refusal("serve", "gcs", "--host", "256.0.0.1").startswith("--host is '256.0.0.1'")
    with GcsServer(quiet_stage()) as server:
        message = refusal("serve", "gcs", "--port", str(server.port))
    assert message.startswith(
        f"--port is {server.port}: expected an address that can be listened at"
    )
