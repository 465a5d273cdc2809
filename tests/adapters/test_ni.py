"""National Instruments' devices: the genuine nidaqmx over a stand-in for the vendor's driver."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from ni_stand_in import NiStandIn

if TYPE_CHECKING:
    from collections.abc import Callable

CHANNELS = "ni:Dev1/ao0,Dev1/ai0"
ADDRESS = f"{CHANNELS}?scale=10um/V&limits=0..7.5V"


def stage() -> pt.hardware.VirtualDevice:
    return pt.hardware.VirtualDevice(pt.VirtualStage.xu_li_2010(seed=3), limits=(0.0, 75.0))


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch) -> Callable[..., NiStandIn]:
    def install(**options: float | str | None) -> NiStandIn:
        stand_in = NiStandIn(stage(), **options)  # type: ignore[arg-type]
        monkeypatch.setattr("nidaqmx.utils._select_interpreter", lambda *_: stand_in)
        return stand_in

    return install


def test_a_table_comes_back_as_the_stage_itself_records_it(
    driver: Callable[..., NiStandIn],
) -> None:
    below = driver()
    device = pt.hardware.connect(ADDRESS)
    volts = 3.0 + 3.0 * np.sin(np.arange(400) / 40.0)
    record = device.play(volts, 1000.0)
    expected = stage().play(volts, 1000.0)
    np.testing.assert_allclose(record.displacement, expected.displacement, rtol=0, atol=1e-15)
    assert record.rate == 1000.0
    assert record.delay == 25e-9
    assert record.lost == 0
    assert below.device.held == volts[-1]
    device.close()


def test_the_input_is_armed_on_the_clock_and_the_trigger_of_the_output(
    driver: Callable[..., NiStandIn],
) -> None:
    below = driver()
    device = pt.hardware.connect(ADDRESS)
    device.play(np.linspace(0.0, 5.0, 50), 500.0)
    ao, ai = [t for t in below.done if t.count == 50]
    if ao.kind != "ao":
        ao, ai = ai, ao
    assert not ao.regenerates
    assert (ai.source, ai.trigger) == ("/Dev1/ao/SampleClock", "/Dev1/ao/StartTrigger")
    assert below.calls.index("start_ai") < below.calls.index("start_ao")
    # The driver itself holds the limits too.
    assert ao.span == (0.0, 7.5)
    assert not below.tasks


def test_rates_are_whole_fractions_of_the_timebase(driver: Callable[..., NiStandIn]) -> None:
    driver(timebase=80e6)
    rates = pt.hardware.connect(ADDRESS).rates
    assert rates.clock == 80e6
    # The slower of output and input.
    assert rates.highest == 1.25e6
    assert rates.nearest(30e3) == pytest.approx(80e6 / 2667)
    given = pt.hardware.connect(f"{ADDRESS}&timebase=10000kHz")
    assert given.rates.clock == 10e6


def test_measure_identifies_the_stage_through_the_driver(
    driver: Callable[..., NiStandIn],
) -> None:
    driver(metres_per_volt=20e-6)
    device = pt.hardware.connect(f"{CHANNELS}?scale=20um/V&limits=0..75V&offset=5um")
    log = pt.measure(device, "decaying:1Hz,0..70V,6s", rate=300.0)
    plain = pt.measure(stage(), "decaying:1Hz,0..70V,6s", rate=300.0)
    assert log.dt == pytest.approx(1.0 / (80e6 / 266667), rel=1e-12)
    assert any("300" in note and "requested" in note for note in log.notes)
    assert any("0.025 us" in note for note in log.notes)
    # The same seed, the same noise: the rates differ in the seventh digit.
    np.testing.assert_allclose(log.y - 5e-6, plain.y, atol=2e-7)


def test_an_input_at_the_end_of_its_range_is_no_reading(driver: Callable[..., NiStandIn]) -> None:
    driver(metres_per_volt=2e-6)
    device = pt.hardware.connect(f"{CHANNELS}?scale=2um/V&limits=0..75V")
    record = device.play(np.linspace(0.0, 75.0, 200), 100.0)
    # 10 V are 20 um.
    assert record.lost > 50
    assert np.nanmax(record.displacement) < 20e-6


def test_a_driver_that_does_not_say_its_delay_gives_a_note(
    driver: Callable[..., NiStandIn],
) -> None:
    driver(delay=None)
    record = pt.hardware.connect(ADDRESS).play(np.zeros(4), 100.0)
    assert record.delay == 0.0
    assert "does not say" in record.notes[0]


def test_lead_in_is_played_and_not_recorded(driver: Callable[..., NiStandIn]) -> None:
    driver()
    device = pt.hardware.connect(ADDRESS)
    volts = np.full(20, 4.0)
    record = device.play(volts, 100.0, lead_in=2.0)
    expected = stage().play(volts, 100.0, lead_in=2.0)
    assert record.volts.size == 20
    np.testing.assert_allclose(record.displacement, expected.displacement, rtol=0, atol=1e-15)


def test_sample_by_sample_then_a_table_then_sample_by_sample(
    driver: Callable[..., NiStandIn],
) -> None:
    below = driver()
    device = pt.hardware.connect(ADDRESS)
    assert isinstance(device, pt.hardware.Exchanging)
    assert np.isfinite(device.exchange(2.0))
    assert below.device.held == 2.0
    device.play(np.linspace(2.0, 0.0, 30), 1000.0)
    device.exchange(1.0)
    device.hold(0.5)
    assert below.device.held == 0.5
    device.close()
    device.close()
    assert not below.tasks
    with pytest.raises(pt.DeviceError, match="closed"):
        device.exchange(0.0)


@pytest.mark.parametrize("call", ["create_ao", "create_ai", "write", "start_ai", "read", "wait"])
def test_errors_of_the_driver_are_sentences_and_leave_no_task(
    driver: Callable[..., NiStandIn], call: str
) -> None:
    below = driver()
    device = pt.hardware.connect(ADDRESS)
    below.fail = call
    with pytest.raises(pt.DeviceError, match=r"Dev1/ao0, play: .*Device identifier") as caught:
        device.play(np.zeros(5), 100.0)
    assert "\n" not in str(caught.value)
    assert not below.tasks


def test_readings_that_the_driver_leaves_out_are_no_record(
    driver: Callable[..., NiStandIn], monkeypatch: pytest.MonkeyPatch
) -> None:
    from nidaqmx.stream_readers import AnalogSingleChannelReader

    below = driver()
    device = pt.hardware.connect(ADDRESS)
    monkeypatch.setattr(AnalogSingleChannelReader, "read_many_sample", lambda *_: 7)
    with pytest.raises(pt.DeviceError, match=r"Dev1/ai0 read 7 samples: expected 50"):
        device.play(np.linspace(0.0, 5.0, 50), 500.0)
    # No task is left, which would keep the channels from the next.
    assert not below.tasks


def test_a_table_that_the_memory_does_not_hold_is_not_played(
    driver: Callable[..., NiStandIn],
) -> None:
    below = driver()
    device = pt.hardware.connect(ADDRESS)
    below.calls.clear()
    with pytest.raises(pt.DeviceError, match=f"expected {device.memory} at most"):
        device.play(np.broadcast_to(1.0, (device.memory,)), 1000.0, lead_in=0.001)
    assert below.calls == []


def test_nothing_beyond_the_limits_reaches_the_driver(driver: Callable[..., NiStandIn]) -> None:
    below = driver()
    device = pt.hardware.connect(ADDRESS)
    below.calls.clear()
    with pytest.raises(pt.DeviceError, match=r"8 V at sample 1: Dev1/ao0 puts out 0 to 7.5 V"):
        device.play(np.array([0.0, 8.0]), 100.0)
    with pytest.raises(pt.DeviceError, match="-1 V"):
        device.hold(-1.0)
    assert below.calls == []


def test_an_output_without_a_sample_clock_is_refused(driver: Callable[..., NiStandIn]) -> None:
    driver(clocked=False)
    with pytest.raises(pt.DeviceError, match=r"Dev1/ao0 is on a USB-6008.*no sample clock"):
        pt.hardware.connect(ADDRESS)


def test_without_the_vendors_driver_it_says_so() -> None:
    """Here it is really absent."""
    with pytest.raises(pt.DeviceError, match=r"Dev1/ao0, connect: the driver says .*NI-DAQmx"):
        pt.hardware.connect(ADDRESS)


def test_without_nidaqmx_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "nidaqmx", None)
    with pytest.raises(pt.DeviceError, match=r"piezotrack\[ni\]"):
        pt.hardware.connect(ADDRESS)


@pytest.mark.parametrize(
    ("address", "sentence"),
    [
        ("ni:Dev1/ao0", "expected ni:DEV/ao0,DEV/ai0"),
        (CHANNELS, "device has no scale: expected ni:"),
        (f"{CHANNELS}?scale=10um/V", "device has no limits"),
        (f"{CHANNELS}?scale=10&limits=0..7V", "scale='10' .*no unit per volt.*10um/V"),
        (f"{CHANNELS}?scale=10V/V&limits=0..7V", "no displacement"),
        (f"{CHANNELS}?scale=10um/um&limits=0..7V", "voltage"),
        (f"{CHANNELS}?scale=0um/V&limits=0..7V", "the scale of the sensor"),
        (f"{CHANNELS}?scale=10um/V&limits=0..7", "limits='0..7'.*expected voltage"),
        (f"{CHANNELS}?scale=10um/V&limits=7V", "LOW..HIGH"),
        (f"{CHANNELS}?scale=10um/V&limits=7..0V", "lower one first"),
        (f"{ADDRESS}&gain=3", "'gain', which it does not know"),
        ("ni:Dev1/ao0,Dev2/ai0?scale=10um/V&limits=0..7V", "channels of one device"),
    ],
)
def test_addresses_that_are_refused(
    driver: Callable[..., NiStandIn], address: str, sentence: str
) -> None:
    driver()
    with pytest.raises(pt.ParameterError, match=sentence):
        pt.hardware.connect(address)
