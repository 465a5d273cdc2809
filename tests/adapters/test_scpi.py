"""SCPI over TCP: against the virtual instrument, and one in another process that misbehaves."""

from __future__ import annotations

import math
import os
import re
import signal
import socket
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from misbehaving import JUMP, misbehaving
from piezotrack._support.units import require
from piezotrack.adapters.scpi_link import number_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

LIST: dict[str, Any] = {
    "upload": "LIST:VOLT {table:.9f}",
    "start": "LIST:RATE {rate:.9g};:INIT",
    "fetch": "FETC?",
    "rates": pt.hardware.Rates(lowest=1.0, highest=10e3),
    "memory": 5000,
}


def stage() -> pt.hardware.VirtualDevice:
    return pt.hardware.VirtualDevice(pt.VirtualStage.xu_li_2010(seed=3))


@contextmanager
def instrument(**options: Any) -> Iterator[tuple[pt.hardware.ScpiDevice, Any]]:
    with pt.hardware.VirtualScpi(stage()) as there:
        device = pt.hardware.ScpiDevice(
            *there.address, **{"unit": "um", "limits": (0.0, 75.0), **options}
        )
        try:
            yield device, there
        finally:
            device.close()


def test_a_list_comes_back_as_the_stage_itself_records_it() -> None:
    volts = 30.0 + 30.0 * np.sin(np.arange(700) / 50.0)
    expected = stage().play(volts, 1000.0)
    with instrument(buffer=pt.hardware.ScpiBuffer(**LIST), errors="SYST:ERR?") as (device, there):
        record = device.play(volts, 1000.0)
        assert there.device.held == pytest.approx(volts[-1], abs=1e-9)
    # The answers have six decimals, in um.
    np.testing.assert_allclose(record.displacement, expected.displacement, rtol=0, atol=1e-12)
    assert record.channels[0].startswith("piezotrack,virtual stage")


def test_a_long_list_goes_out_in_parts() -> None:
    volts = np.linspace(0.0, 60.0, 1234)
    in_parts = pt.hardware.ScpiBuffer(**LIST, append="LIST:VOLT:APP {table:.9f}", chunk=100)
    with instrument(buffer=in_parts) as (device, _):
        parts = device.play(volts, 500.0, lead_in=0.1)
    with instrument(buffer=pt.hardware.ScpiBuffer(**LIST)) as (device, _):
        whole = device.play(volts, 500.0, lead_in=0.1)
    assert parts.volts.size == 1234
    np.testing.assert_array_equal(parts.displacement, whole.displacement)


def test_measure_through_the_buffer_identifies() -> None:
    with instrument(buffer=pt.hardware.ScpiBuffer(**LIST)) as (device, _):
        log = pt.measure(device, "decaying:1Hz,0..75V,6s", rate=500.0)
    fit = pt.identify(log, "prandtl-ishlinskii")
    assert fit.score(log).fit_percent > 95.0


def test_sample_by_sample_is_one_message_a_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[str] = []
    with instrument() as (device, there):
        whole: Callable[[str], str | None] = there.answer

        def spy(line: str) -> str | None:
            lines.append(line)
            return whole(line)

        monkeypatch.setattr(there, "answer", spy)
        readings = [device.exchange(float(volts)) for volts in range(5)]
        assert isinstance(device, pt.hardware.Exchanging)
        assert there.device.held == 4.0
    assert lines == [f"VOLT {k:.6f};:MEAS?" for k in range(5)]
    assert np.all(np.isfinite(readings))


def test_two_lines_in_one_segment_where_an_instrument_does_not_join() -> None:
    with instrument(exchange="VOLT {volts:.3f}\nMEAS?") as (device, there):
        assert math.isfinite(device.exchange(3.0))
        assert there.device.held == 3.0


def test_without_a_buffer_the_computer_paces_and_says_its_round_trip() -> None:
    with instrument() as (device, _):
        record = device.play(np.linspace(0.0, 5.0, 20), 50.0)
    assert record.volts.size == 20
    assert "paced by the computer" in record.notes[0]
    assert "round trip" in record.notes[0]


def test_what_is_late_has_no_reading_and_what_is_too_late_ends() -> None:
    """On a clock of its own: sample 5 takes 30 ms, of an interval of 10."""
    now, done = [0.0], [0]

    def exchange(volts: float) -> float:
        done[0] += 1
        # The first exchange is before the record.
        now[0] += 0.030 if done[0] == 7 else 0.001
        return volts * 1e-6

    def sleep(wait: float) -> None:
        now[0] += wait

    clock = {"clock": lambda: now[0], "sleep": sleep}
    record = pt.hardware.play_paced(exchange, np.arange(12.0), 100.0, **clock)  # type: ignore[arg-type]
    # Sample 5 ends 20 ms after sample 6 was due; 6 is 20 ms late, 7 is 11, 8 is 2.
    assert np.flatnonzero(np.isnan(record.displacement)).tolist() == [6, 7]
    assert "2 samples more than half an interval late" in record.notes[0]
    with pytest.raises(pt.DeviceError, match=r"device is 1 s behind .*lower rate"):
        pt.hardware.play_paced(exchange, np.zeros(5000), 2000.0, **clock)  # type: ignore[arg-type]


def test_an_error_that_the_instrument_keeps_is_said() -> None:
    with instrument(limits=(0.0, 100.0), errors="SYST:ERR?") as (device, _):
        device.hold(1.0)
        with pytest.raises(pt.DeviceError, match=r"'SYST:ERR\?' with .*-222.*expected 0, no error"):
            device.hold(90.0)
        device.hold(2.0)


def test_nothing_beyond_the_limits_is_sent() -> None:
    with instrument() as (device, there):
        with pytest.raises(pt.DeviceError, match=r"80 V at sample 1: 127.* puts out 0 to 75 V"):
            device.play(np.array([0.0, 80.0]), 100.0)
        with pytest.raises(pt.DeviceError, match="-1 V"):
            device.exchange(-1.0)
        assert there.device.held == 0.0
        device.close()
        with pytest.raises(pt.DeviceError, match="is closed"):
            device.exchange(0.0)


def test_a_list_of_the_wrong_length_is_no_record() -> None:
    short = pt.hardware.ScpiBuffer(**{**LIST, "fetch": "MEAS?"})
    with (
        instrument(buffer=short) as (device, _),
        pytest.raises(pt.DeviceError, match=r"1 readings.*expected 3 readings"),
    ):
        device.play(np.zeros(3), 100.0)


def test_a_list_that_the_memory_does_not_hold_is_not_sent() -> None:
    with instrument(buffer=pt.hardware.ScpiBuffer(**LIST)) as (device, there):
        with pytest.raises(pt.DeviceError, match=r"5001 samples with its lead-in.*5000"):
            device.play(np.full(5000, 5.0), 1000.0, lead_in=0.001)
        assert there.device.held == 0.0


def test_a_list_is_divided_only_where_its_parts_can_be_joined() -> None:
    with pytest.raises(
        pt.ParameterError, match=r"chunk is 100 and append is None: .*both, or none"
    ):
        pt.hardware.ScpiBuffer(**LIST, chunk=100)


def test_measured_round_trips() -> None:
    with instrument() as (device, _):
        trip = pt.hardware.round_trip(device, 0.0, count=50)
    assert trip.count == 50
    assert 0.0 < trip.median <= trip.p99 <= trip.worst
    with pytest.raises(pt.ParameterError, match="without exchange"):
        pt.hardware.round_trip(object(), 0.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("answer", "metres"),
    [
        ("1.5", 1.5e-6),
        ("+1.500000E+00", 1.5e-6),
        ("-.5", -0.5e-6),
        ("12 um", 12e-6),
        ("12UM", 12e-6),
        ("9.9E37", math.nan),
        ("-9.9E+37", math.nan),
        ("9.91E37", math.nan),
        ("NAN", math.nan),
    ],
)
def test_answers_that_are_numbers(answer: str, metres: float) -> None:
    assert number_of(answer, require("um")) == pytest.approx(metres, rel=1e-15, nan_ok=True)


@pytest.mark.parametrize(
    "answer", ["", "busy", "12 nm", "12 V", "1.5E", "1,5", "1.5;2", "0x10", "1_0"]
)
def test_answers_that_are_none(answer: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(answer)}$"):
        number_of(answer, require("um"))


# Faults of a genuine instrument in another process.


def misbehaved(place: tuple[str, int], **options: Any) -> pt.hardware.ScpiDevice:
    return pt.hardware.ScpiDevice(*place, unit="um", limits=(0.0, 75.0), **options)


@pytest.mark.parametrize(
    ("fault", "sentence"),
    [
        ("silent", r"did not answer 'VOLT 1.000000;:MEAS\?' within 1 s"),
        ("late", r"did not answer 'VOLT 1.000000;:MEAS\?' within 1 s"),
        ("half", r"answered 'VOLT 1.000000;:MEAS\?' with '.+', no end of line within 1 s"),
        ("drop", r"did not answer 'VOLT 1.000000;:MEAS\?' and closed the connection"),
        ("nm unit", r"with '.+ nm': expected a number in um"),
        ("twice", r"with '.+' and then '.+': expected one line"),
        ("garbage", r"with 'busy': expected a number in um"),
    ],
)
def test_a_fault_that_can_be_seen_is_a_sentence(fault: str, sentence: str) -> None:
    with misbehaving(fault, after=2, late=3.0) as place:
        device = misbehaved(place, timeout=1.0)
        assert all(math.isfinite(device.exchange(1.0)) for _ in range(2))
        with pytest.raises(pt.DeviceError, match=sentence) as caught:
            device.exchange(1.0)
        assert str(caught.value).startswith(f"127.0.0.1:{place[1]} ")
        device.close()


def test_a_late_answer_is_never_taken_for_the_next() -> None:
    with misbehaving("late", after=0, late=3.0) as place:
        device = misbehaved(place, timeout=1.0)
        with pytest.raises(pt.DeviceError, match="within 1 s"):
            device.exchange(20.0)
        with pytest.raises(pt.DeviceError, match="did not answer"):
            device.exchange(40.0)
        device.close()


@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C in another way")
def test_the_answer_to_an_interrupted_message_is_never_taken_for_the_next() -> None:
    with misbehaving("late", after=0, count=1, late=1.0) as place:
        device = misbehaved(place, timeout=30.0)
        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            device.exchange(20.0)
        device.hold(3.0)
        assert math.isfinite(device.exchange(3.0))
        device.close()


def test_not_a_number_is_no_reading_and_the_rest_goes_on() -> None:
    with misbehaving("nan", after=1) as place:
        device = misbehaved(place)
        assert math.isfinite(device.exchange(1.0))
        assert math.isnan(device.exchange(1.0))
        device.hold(0.0)
        device.close()


@pytest.mark.slow
def test_faults_that_the_adapter_cannot_see_do_what_they_should() -> None:
    """They are for the guard of a loop: here only that the imitation has them."""
    readings = {}
    for fault in ("none", "stale", "nm", "jump", "clip"):
        with misbehaving(fault, after=1) as place:
            device = misbehaved(place)
            # The first is before the fault. The stage moves in the time of the computer.
            for _ in range(2):
                device.exchange(60.0)
                time.sleep(0.5)
            readings[fault] = [device.exchange(60.0) for _ in range(20)]
            device.close()
    settled = {fault: float(np.median(values)) for fault, values in readings.items()}
    assert len(set(readings["stale"])) == 1
    assert len(set(readings["none"])) > 2
    assert settled["nm"] == pytest.approx(1e3 * settled["none"], rel=0.02)
    assert settled["jump"] - settled["none"] == pytest.approx(JUMP * 1e-6, rel=0.1)
    assert settled["clip"] < 0.75 * settled["none"]


def test_a_play_that_is_cut_off_ends_at_rest() -> None:
    with misbehaving("drop", after=20, count=1) as place:
        device = misbehaved(place)
        with pytest.raises(pt.DeviceError, match="closed the connection"):
            pt.measure(device, np.full(100, 40.0), rate=100.0, ramp=0.1)
        device.close()
        # The instrument itself says what it puts out.
        failing = misbehaved(place, exchange="VOLT?;:VOLT {volts:.6f};:VOLT?")
        with pytest.raises(pt.DeviceError, match=r"with '0;1'"):
            failing.exchange(1.0)
        failing.close()


def test_after_a_lost_connection_the_output_can_still_be_led_home() -> None:
    with instrument() as (device, there):
        device.exchange(5.0)
        # What an instrument that is switched off and on leaves.
        device._link.close()
        device.hold(1.0)
        assert there.device.held == 1.0


def test_nobody_there() -> None:
    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]
    with pytest.raises(pt.DeviceError, match=f"127.0.0.1:{port} does not answer: .*refused"):
        pt.hardware.connect(f"scpi://127.0.0.1:{port}?unit=um&limits=0..75V")


def test_a_place_where_it_cannot_listen() -> None:
    with pt.hardware.VirtualScpi(stage()) as there:
        port = there.address[1]
        second = pt.hardware.VirtualScpi(stage(), port=port)
        with pytest.raises(pt.ParameterError, match=f"port is {port}: expected"):
            second.__enter__()
    with pytest.raises(pt.ParameterError, match="port is 70000: expected 0 to 65535"):
        pt.hardware.VirtualScpi(stage(), port=70000)


def test_an_address_says_everything() -> None:
    with pt.hardware.VirtualScpi(stage()) as there:
        host, port = there.address
        device = pt.hardware.connect(
            f"scpi://{host}:{port}?unit=um&limits=0..75V&exchange=VOLT {{volts:.3f}};:MEAS?"
            "&timeout=500ms&upload=LIST:VOLT {table:.6f}&start=LIST:RATE {rate:.9g};:INIT"
            "&fetch=FETC?&rates=1..10000Hz&clock=10kHz&memory=4096&errors=SYST:ERR?"
        )
        assert device.memory == 4096
        assert device.rates == pt.hardware.Rates(lowest=1.0, highest=10e3, clock=10e3)
        assert device.play(np.zeros(3), 100.0).lost == 0
        device.close()


@pytest.mark.parametrize(
    ("rest", "sentence"),
    [
        ("", "no host and port: expected scpi://HOST:PORT"),
        ("//127.0.0.1", "no host and port"),
        ("//127.0.0.1:1", "has no unit"),
        ("//127.0.0.1:1?unit=V&limits=0..7V", "unit of voltage"),
        ("//127.0.0.1:1?unit=um&limits=0..7um", "limits='0..7um'"),
        ("//127.0.0.1:1?unit=um&limits=0..7V&exchange=MEAS?", r"exchange is .*\{volts\}"),
        ("//127.0.0.1:1?unit=um&limits=0..7V&exchange=V {volts:q}", r"exchange is .*format"),
        ("//127.0.0.1:1?unit=um&limits=0..7V&exchange=V {volts} {more}", "exchange is"),
        ("//127.0.0.1:1?unit=um&limits=0..7V&upload=L {table}", "has no rates"),
        ("//127.0.0.1:1?unit=um&limits=0..7V&voltage=5", "'voltage', which it does not know"),
    ],
)
def test_addresses_that_are_refused(rest: str, sentence: str) -> None:
    with pytest.raises(pt.ParameterError, match=sentence):
        pt.hardware.connect(f"scpi:{rest}")


# What a template writes.


@pytest.mark.parametrize(
    ("template", "volts", "is_refused"),
    [
        ("VOLT {volts:.0f};:MEAS?", 74.6, True),
        ("VOLT {volts:.0f};:MEAS?", 74.4, False),
        ("VOLT {volts:.0f};:MEAS?", 0.1 + 0.2, True),
        ("VOLT {volts:.2e};:MEAS?", 74.6, False),
        ("VOLT {volts:.1e};:MEAS?", 74.6, True),
        ("VOLT {volts:.6f};:MEAS?", 74.6, False),
        ("VOLT {volts};:MEAS?", 0.1 + 0.2, False),
    ],
)
def test_a_voltage_is_within_the_limits_as_it_is_written(
    template: str, volts: float, is_refused: bool
) -> None:
    with instrument(exchange=template, limits=(0.1 + 0.2, 74.6)) as (device, there):
        before = there.device.held
        for call in (device.exchange, device.hold):
            if is_refused:
                with pytest.raises(pt.DeviceError, match=re.escape(template[:12])):
                    call(volts)
                assert there.device.held == before
            else:
                call(volts)
                assert 0.3 <= there.device.held <= 74.6


def test_a_table_is_within_the_limits_as_it_is_written() -> None:
    rough = {**LIST, "upload": "LIST:VOLT {table:.2f}", "append": "LIST:VOLT:APP {table:.0f}"}
    buffer = pt.hardware.ScpiBuffer(**rough, chunk=10)
    with instrument(buffer=buffer, limits=(0.0, 74.6)) as (device, there):
        device.play(np.linspace(0.0, 74.0, 30), 100.0)
        there.device.hold(1.0)
        with pytest.raises(pt.DeviceError, match=r"75 V by 'LIST:VOLT:APP \{table:.0f\}'"):
            device.play(np.linspace(0.0, 74.6, 30), 100.0)
        # Nothing of it has been sent.
        assert there.device.held == 1.0
        assert device.play(np.full(3, 74.0), 100.0).lost == 0


@pytest.mark.parametrize("template", ["VOLT {volts:.0%}", "VOLT {volts:_.1f} {volts:_>9.1f}"])
def test_a_template_that_writes_no_number_is_refused(template: str) -> None:
    with pytest.raises(pt.ParameterError, match="exchange is 'VOLT"):
        pt.hardware.ScpiDevice("127.0.0.1", 1, unit="um", limits=(0.0, 1.0), exchange=template)
