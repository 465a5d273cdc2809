"""Our client in front of our virtual controller: what comes back is what the stage did."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from gcs_peers import LIMITS, quiet_stage
from piezotrack.hardware import GcsDevice, GcsServer

if TYPE_CHECKING:
    from collections.abc import Iterator

    from piezotrack.hardware import Device


@pytest.fixture(scope="module")
def server() -> Iterator[GcsServer]:
    with GcsServer(quiet_stage(), speed=100.0) as server:
        yield server


@pytest.fixture
def device(server: GcsServer) -> Iterator[GcsDevice]:
    device = GcsDevice("127.0.0.1", server.port)
    # Round trips enough for the mode to come to rest, whatever was before.
    for _ in range(200):
        device.exchange(0.0)
    yield device
    device.close()


DRIVE = "decaying:2Hz,0..75V,3s"


def measured(device: Device) -> pt.Dataset:
    return pt.measure(device, DRIVE, rate=1000.0)


def test_a_log_over_tcp_is_that_of_the_stage_itself() -> None:
    with GcsServer(quiet_stage(), speed=100.0) as server:
        over_tcp = pt.hardware.connect(server.address)
        far = measured(over_tcp)
        over_tcp.close()
    near = measured(pt.hardware.VirtualDevice(quiet_stage()))
    assert far.dt == near.dt
    # Nine digits of a voltage and of a position are on the line.
    np.testing.assert_allclose(far.u, near.u, rtol=0.0, atol=75e-9)
    np.testing.assert_allclose(far.y, near.y, rtol=0.0, atol=1e-12)
    models = [pt.identify(log, "prandtl-ishlinskii").model for log in (far, near)]
    assert isinstance(models[0], pt.stages.PrandtlIshlinskiiStage)
    assert isinstance(models[1], pt.stages.PrandtlIshlinskiiStage)
    drive = 75.0 * np.sin(np.linspace(0.0, 10.0, 2000)) ** 2
    responses = [one.simulate(drive, 1e-3).x for one in models]
    np.testing.assert_allclose(responses[0], responses[1], rtol=0.0, atol=1e-9)


def test_it_is_a_device_that_can_be_asked_sample_by_sample(device: GcsDevice) -> None:
    assert isinstance(device, pt.hardware.Device)
    assert isinstance(device, pt.hardware.Exchanging)
    assert device.limits == LIMITS
    # 20 kHz of servo clock; a quarter of 262144 points for each of four tables of the recorder.
    assert device.rates == pt.hardware.Rates(lowest=2.0, highest=20e3, clock=20e3)
    assert device.memory == 65536
    assert device.channels[0].startswith("gcs://127.0.0.1:")


def test_an_exchange_reads_before_it_puts_out(device: GcsDevice) -> None:
    at_rest = device.position
    assert device.exchange(50.0) == pytest.approx(at_rest, abs=1e-9)
    assert device.voltage == 50.0
    # A stage with 1 um/V at least, some periods of its mode later.
    later = [device.exchange(50.0) for _ in range(200)]
    assert later[-1] > at_rest + 45e-6


def test_a_held_voltage_moves_the_stage_in_its_travel(device: GcsDevice) -> None:
    low, high = device.travel
    assert 75e-6 < high - low < 200e-6
    device.hold(75.0)
    for _ in range(200):
        position = device.position
    assert position == pytest.approx(high, abs=0.01 * (high - low))


def test_the_first_voltage_of_a_table_is_held_in_a_lead_in(device: GcsDevice) -> None:
    record = device.play(np.full(100, 40.0), 2000.0, lead_in=0.5)
    assert record.volts.tolist() == [40.0] * 100
    # 80 periods of the mode after the step the stage rests, to a share of exp(-zeta omega t).
    assert np.ptp(record.displacement) < 1e-9
    assert device.voltage == 40.0
    without = device.play(np.full(100, 10.0), 2000.0)
    assert np.ptp(without.displacement) > 10e-6


def test_a_lead_in_beyond_the_memory_is_waited_for(device: GcsDevice) -> None:
    record = device.play(np.full(device.memory, 20.0), 20e3, lead_in=0.01)
    assert record.volts.size == device.memory
    assert np.ptp(record.displacement[-1000:]) < 1e-9


@pytest.mark.parametrize("rate", [20e3, 3000.0, 999.0, 2.0])
def test_a_rate_is_a_whole_fraction_of_the_servo_clock(device: GcsDevice, rate: float) -> None:
    near = device.rates.nearest(rate)
    record = device.play(np.linspace(0.0, 1.0, 40), near)
    assert record.rate == pytest.approx(near)
    cycles = 20e3 / record.rate
    assert cycles == pytest.approx(round(cycles), rel=1e-12)


def test_a_log_says_that_its_rate_was_rounded(device: GcsDevice) -> None:
    log = pt.measure(device, DRIVE, rate=3000.0)
    assert 1.0 / log.dt == pytest.approx(20e3 / 7)
    assert any("2857.143 Hz, requested" in note for note in log.notes)


def test_a_table_longer_than_the_memory_is_refused_before_it_is_sent(device: GcsDevice) -> None:
    with pytest.raises(pt.DeviceError, match=r"65537 samples: the memory of gcs.* holds 65536"):
        device.play(np.zeros(65537), 1000.0)
    with pytest.raises(pt.ParameterError, match="expected at most 65536"):
        pt.measure(device, np.zeros(70000), rate=1000.0)
    assert device.position == device.position


@pytest.mark.parametrize("volts", [-0.1, 75.1, np.nan])
def test_a_voltage_beyond_the_limits_is_not_sent(device: GcsDevice, volts: float) -> None:
    with pytest.raises(pt.PiezotrackError, match=r"puts out 0 to 75 V|finite"):
        device.hold(volts)
    with pytest.raises(pt.PiezotrackError, match=r"puts out 0 to 75 V|finite|NaN|nan"):
        device.play(np.array([0.0, volts]), 1000.0)
    assert device.voltage == 0.0


def test_two_clients_see_the_same_stage(server: GcsServer, device: GcsDevice) -> None:
    other = pt.hardware.connect(server.address)
    assert isinstance(other, GcsDevice)
    device.hold(30.0)
    assert other.voltage == 30.0
    other.close()


def test_what_is_closed_is_refused_and_closed_again_without_a_word(server: GcsServer) -> None:
    device = GcsDevice("127.0.0.1", server.port)
    device.close()
    device.close()
    for call in (lambda: device.hold(1.0), lambda: device.play(np.zeros(2), 1000.0)):
        with pytest.raises(pt.DeviceError, match="is closed"):
            call()


def test_options_of_an_address(server: GcsServer) -> None:
    device = pt.hardware.connect(f"{server.address}/1?limits=5..60V&timeout=9s&factor=2V")
    assert device.limits == (5.0, 60.0)
    device.hold(40.0)
    assert isinstance(device, GcsDevice)
    # A control value of 1 is taken for 2 V: what goes out is half.
    assert device.voltage == 20.0
    record = device.play(np.full(50, 10.0), 1000.0)
    assert record.notes == ("output: up to 5 V other than the table, as the data recorder says",)
    device.close()


@pytest.mark.parametrize(
    ("rest", "pieces"),
    [
        ("?limits=5V", ("limits='5V'", "LOW..HIGH with its unit")),
        ("?limits=a..bV", ("limits='a..bV'", "LOW..HIGH with its unit")),
        ("?limits=5..60um", ("limits='5..60um'", "expected voltage")),
        ("?limits=9..1V", ("lower one first",)),
        ("?factor=0V", ("factor is 0",)),
        ("?factor=x", ("factor='x'", "voltage with its unit")),
        ("?factor=2", ("factor='2'", "voltage with its unit")),
        ("?timeout=-1s", ("timeout is -1",)),
        ("?speed=2", ("'speed'", "[&factor=1V][&timeout=5s]")),
        ("/x", ("axis is 'x'",)),
    ],
)
def test_a_bad_address_is_one_sentence(
    server: GcsServer, rest: str, pieces: tuple[str, ...]
) -> None:
    with pytest.raises(pt.ParameterError) as refused:
        pt.hardware.connect(server.address + rest)
    for piece in pieces:
        assert piece in str(refused.value)
    with pytest.raises(pt.ParameterError, match="no host"):
        pt.hardware.connect("gcs:")


def test_an_axis_that_is_not_there_is_refused_in_the_controllers_words(server: GcsServer) -> None:
    with pytest.raises(pt.DeviceError, match=r"'PUN\? 3' is refused: error 15 \(invalid axis"):
        GcsDevice("127.0.0.1", server.port, axis="3", timeout=0.2)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"speed": 0.0}, "speed is 0"),
        ({"port": 70000}, "port is 70000: expected 0 to 65535"),
        ({"limits": (5.0, 5.0)}, "5 to 5 V: expected the lower one first"),
        ({"host": "256.0.0.1"}, "host is '256.0.0.1'"),
    ],
)
def test_a_server_that_cannot_be_is_refused(arguments: dict[str, object], words: str) -> None:
    with pytest.raises(pt.ParameterError, match=words):
        GcsServer(quiet_stage(), **arguments)  # type: ignore[arg-type]
    with pytest.raises(pt.ParameterError, match=r"expected pt\.VirtualStage"):
        GcsServer(None)  # type: ignore[arg-type]


def test_a_port_that_is_taken_is_refused(server: GcsServer) -> None:
    with pytest.raises(
        pt.ParameterError,
        match=f"port is {server.port}: expected",
    ):
        GcsServer(quiet_stage(), port=server.port)
