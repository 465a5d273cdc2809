"""`measure` on devices: what is asked of them, what comes back, what is refused before."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.hardware import Rates, Record, VirtualDevice

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

PLAYS = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0, 15.0), weights=(4e-7, 3e-7))
UM = 1e-6


def device(noise: float = 0.0, **others: object) -> VirtualDevice:
    stage = pt.VirtualStage.of(PLAYS, noise=noise, limits=(0.0, 75.0))
    return VirtualDevice(stage, **others)  # type: ignore[arg-type]


class Odd(VirtualDevice):
    """Returns another record than was made."""

    def __init__(self, **changed: object) -> None:
        super().__init__(pt.VirtualStage.of(PLAYS, limits=(0.0, 75.0)))
        self.changed = changed

    def play(self, volts: Array, rate: float, *, lead_in: float = 0.0) -> Record:
        made = super().play(volts, rate, lead_in=lead_in)
        return replace(made, **self.changed)  # type: ignore[arg-type]


def test_the_log_is_that_of_the_stage_and_identifies_it() -> None:
    noise = 5e-9
    log = pt.measure(device(noise), "decaying:2Hz,0..75V,6s", rate=500.0)
    assert (log.hold, log.warmup, len(log)) == ("zoh", 250, 3000)
    # A voltage shows from the next sample on.
    volts = log.full.u
    there = PLAYS.simulate(np.concatenate([[0.0], volts[:-1]]), 1 / 500.0).x
    assert np.std(log.full.y - there) == pytest.approx(noise, rel=0.05)
    fit = pt.identify(log, "prandtl-ishlinskii")
    assert fit.cost == pytest.approx(noise, rel=0.1)


def test_the_output_begins_and_ends_at_rest_without_a_jump() -> None:
    used = device()
    log = pt.measure(used, "triangle:1Hz,20..60V,2s", rate=200.0, rest=10.0, ramp=0.5)
    steps = np.abs(np.diff(log.full.u))
    assert log.full.u[0] == 10.0
    # No faster than a smooth ramp of 50 V in 0.5 s, 1.875 times its mean.
    assert steps.max() <= 1.875 * 50.0 / 0.5 / 200.0
    assert used.held == 10.0
    assert log.u[0] == pytest.approx(20.0)


def test_a_device_remembers_where_it_has_been() -> None:
    used = device()
    first = pt.measure(used, "sine:1Hz,0..75V,1s", rate=200.0)
    again = pt.measure(used, "sine:1Hz,0..75V,1s", rate=200.0)
    # What is left at 0 V after an excursion of 75 V: both plays are dragged up to u - r, and back
    # to r.
    left = 4e-7 * 5.0 + 3e-7 * 15.0
    assert first.full.y[0] == 0.0
    assert again.full.y[0] == pytest.approx(left, abs=1e-12)


@pytest.mark.parametrize(
    ("drive", "rate", "words"),
    [
        (
            "sine:1Hz,-5..75V",
            100.0,
            ("drive is -5 V at sample 0", "0 to 75 V", "virtual amplifier"),
        ),
        ("sine:1Hz,0..80V", 100.0, ("drive is 75.0", "0 to 75 V")),
        ("sine:1Hz,0..75um", 100.0, ("'0..75um'", "sine:0.5Hz,0..75V")),
        ("sine:1Hz,0..75", 100.0, ("has no unit", "0..75V")),
        ("sine:1Hz,0..75V", 1e9, ("rate is 1e+09 Hz", "0.1 to 100000 Hz")),
        ("sine:1Hz,0..75V", 0.0, ("rate", "above 0")),
        ("sine:1Hz,0..75V,1000s", 100e3, ("samples", "at most 10000000, the memory")),
        ("gone.csv", 100.0, ("gone.csv",)),
        (np.array([0.0, np.nan]), 100.0, ("drive is nan at sample 1",)),
        (np.array([]), 100.0, ("drive has 0 samples: expected at least 3",)),
        (np.zeros((2, 2)), 100.0, ("drive has the shape (2, 2)",)),
    ],
)
def test_what_is_asked_wrongly_is_refused_before_it_goes_out(
    drive: str | Array, rate: float, words: tuple[str, ...]
) -> None:
    used = device()
    with pytest.raises(pt.PiezotrackError) as caught:
        pt.measure(used, drive, rate=rate)
    for word in words:
        assert word in str(caught.value)
    assert used.held == 0.0


@pytest.mark.parametrize("ramp", [1e5, 1e300])
def test_a_way_from_rest_that_the_memory_does_not_hold_is_refused_at_once(ramp: float) -> None:
    with pytest.raises(pt.ParameterError, match=r"ramp is 1\S+ s: expected at most 10000 s"):
        pt.measure(device(), "sine:1Hz,0..75V", rate=1000.0, ramp=ramp)


def test_a_virtual_stage_refuses_what_a_device_cannot_do() -> None:
    stage = pt.VirtualStage.xu_li_2010(seed=1)
    device = pt.hardware.VirtualDevice(stage, memory=100)
    with pytest.raises(pt.DeviceError, match="101 samples: the memory holds 100"):
        device.play(np.full(101, 5.0), 1000.0)
    assert device.held == 0.0
    device.close()
    with pytest.raises(pt.DeviceError, match="is closed"):
        device.hold(5.0)
    assert device.held == 0.0


def test_a_virtual_stage_of_a_model_file_moves_as_the_model(tmp_path: Path) -> None:
    plays = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(1e-7,))
    bare = pt.identification.IdentifiedModel(
        model=plays, offset=3e-6, offset_fitted=True, stroke=40e-6
    )
    whole = replace(bare, details={"provenance": {"data": {"drive_range": [0.0, 40.0]}}})
    whole.save(tmp_path / "model.json")
    device = pt.hardware.connect(f"virtual:{tmp_path / 'model.json'}")
    with pytest.raises(pt.DeviceError, match="50 V"):
        device.hold(50.0)
    u = 20.0 - 20.0 * np.cos(2.0 * np.pi * np.arange(3000) / 1000.0)
    moved = device.play(u, 1000.0).displacement
    # A sample is read when its voltage goes out, before the stage follows.
    np.testing.assert_allclose(moved[1:], plays.simulate(u, 1e-3).x[:-1] + 3e-6, atol=1e-9)
    with pytest.raises(pt.ParameterError, match="expected virtual:, virtual:MODEL"):
        pt.hardware.connect(f"virtual:{tmp_path / 'model.json'}?one")
    # Nobody knows which voltages the stage bears.
    bare.save(tmp_path / "bare.json")
    with pytest.raises(pt.ParameterError, match=r"bare.json is without the range of its drive"):
        pt.hardware.connect(f"virtual:{tmp_path / 'bare.json'}")


def test_a_virtual_stage_that_was_left_alone_for_a_day_answers() -> None:
    now = [0.0]
    used = device(clock=lambda: now[0])
    used.hold(30.0)
    now[0] = 86_400.0
    before = used.exchange(30.0)
    now[0] += 1e-3
    assert used.exchange(30.0) == pytest.approx(before, abs=1e-9)
    assert before > 20e-6


class Failing(pt.hardware.VirtualDevice):
    """Fails at 60 V in a table, and says at which voltage its output is, or does not."""

    def __init__(self, voltage: float | None) -> None:
        super().__init__(pt.VirtualStage.of(PLAYS), limits=(0.0, 75.0))
        self.went: list[float] = []
        if voltage is not None:
            self.voltage = voltage

    def play(self, volts: Array, rate: float, *, lead_in: float = 0.0) -> Record:
        del volts, rate, lead_in
        super().hold(60.0)
        raise pt.DeviceError("it failed")

    def hold(self, volts: float) -> None:
        super().hold(volts)
        self.went.append(volts)


@pytest.mark.parametrize("says", [60.0, None, np.nan])
def test_after_a_failure_the_output_is_led_down_slowly_where_it_is_known(says: Any) -> None:
    used = Failing(says)
    with pytest.raises(pt.DeviceError, match="it failed"):
        pt.measure(used, "sine:1Hz,0..75V,1s", rate=100.0)
    if says is None or np.isnan(says):
        assert used.went == [0.0]
        return
    steps = np.diff([60.0, *used.went])
    assert used.went[-1] == 0.0
    assert len(steps) > 20
    assert np.all(steps <= 0.0)
    # No jump, however busy the machine is: a step in one go would be 60 V.
    assert np.abs(steps).max() < 30.0


@pytest.mark.parametrize("lead_in", [-1.0, 3601.0, 1e300, np.nan])
def test_a_time_at_rest_that_cannot_be_meant_is_refused(lead_in: float) -> None:
    with pytest.raises(
        pt.ParameterError, match=r"lead_in is .*: expected a finite number from 0 to"
    ):
        pt.measure(device(), "sine:1Hz,0..75V,1s", rate=100.0, lead_in=lead_in)


def test_a_drive_beyond_the_limits_is_clipped_where_that_is_asked() -> None:
    log = pt.measure(device(), "sine:1Hz,-10..80V,1s", rate=100.0, clip=True)
    assert (log.u.min(), log.u.max()) == (0.0, 75.0)
    assert any("clipped to 0 and 75 V" in note for note in log.notes)


def test_a_rate_that_the_device_rounds_is_in_the_log() -> None:
    used = device(rates=Rates(lowest=1.0, highest=1000.0, clock=1000.0))
    log = pt.measure(used, "sine:1Hz,0..75V,1s", rate=300.0)
    assert log.dt == pytest.approx(3.0 / 1000.0)
    assert log.notes == ("rate: 333.3333 Hz, requested 300 Hz",)
    with pytest.raises(pt.ParameterError, match=r"expected 333\.333333 Hz"):
        pt.measure(used, [0.0, 1.0, 2.0], rate=300.0)


def test_a_few_lost_samples_are_filled_in_and_many_are_refused() -> None:
    y = np.zeros(201)
    y[[40, 41]] = np.nan
    # The table has its ramps around the 99 samples.
    short = {"ramp": 0.5, "rate": 100.0, "drive": np.zeros(100)}
    log = pt.measure(Odd(displacement=y, delay=2e-5), **short)  # type: ignore[arg-type]
    assert "lost samples: 2 of 201, filled in linearly" in log.notes
    assert any("20 us" in note for note in log.notes)
    y[50:60] = np.nan
    with pytest.raises(pt.DataError, match=r"12 of 201 samples .* the first at 0\.4 s"):
        pt.measure(Odd(displacement=y), **short)  # type: ignore[arg-type]


def test_a_record_that_does_not_belong_to_the_table_is_refused_and_the_output_safe() -> None:
    short = {"rate": 100.0, "drive": np.full(100, 30.0), "rest": 5.0}
    used = Odd(rate=99.0)
    with pytest.raises(pt.DeviceError, match="played at 99 Hz: expected 100 Hz"):
        pt.measure(used, **short)  # type: ignore[arg-type]
    assert used.held == 5.0
    used = Odd(volts=np.zeros(9), displacement=np.zeros(9))
    with pytest.raises(pt.DeviceError, match="recorded 9 samples: expected 201"):
        pt.measure(used, **short)  # type: ignore[arg-type]


def test_what_is_no_device_is_named() -> None:
    with pytest.raises(pt.ParameterError, match="device is VirtualStage, without"):
        pt.measure(pt.VirtualStage.of(PLAYS), "sine:1Hz,0..75V", rate=100.0)  # type: ignore[arg-type]


def test_addresses() -> None:
    with pytest.raises(pt.ParameterError, match="device is 'usb:1': expected an address"):
        pt.hardware.connect("usb:1")
    with pytest.raises(pt.DataError, match=r"gone\.json"):
        pt.hardware.connect("virtual:gone.json")


def test_a_device_that_cannot_be_led_back_is_said_to_be_anywhere() -> None:
    class Lost(VirtualDevice):
        def play(self, volts: Array, rate: float, *, lead_in: float = 0.0) -> Record:
            del volts, rate, lead_in
            raise pt.DeviceError("the connection was lost")

        def hold(self, volts: float) -> None:
            del volts
            raise pt.DeviceError("nobody answers")

    used = Lost(pt.VirtualStage.of(PLAYS, limits=(0.0, 75.0)))
    with pytest.raises(
        pt.DeviceError, match=r"lost; .* 0 V \(nobody answers\): it may be anywhere"
    ):
        pt.measure(used, "sine:1Hz,0..75V", rate=100.0)


@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C in another way")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_leads_the_output_to_rest_even_where_it_comes_twice(
    number: signal.Signals,
) -> None:
    class Interrupted(VirtualDevice):
        holds = 0

        def play(self, volts: Array, rate: float, *, lead_in: float = 0.0) -> Record:
            super().play(volts[: volts.size // 2], rate, lead_in=lead_in)
            os.kill(os.getpid(), number)
            raise AssertionError("it is not interrupted")

        def hold(self, volts: float) -> None:
            self.holds += 1
            if self.holds == 1:
                os.kill(os.getpid(), number)
            super().hold(volts)

    before = signal.getsignal(signal.SIGTERM)
    used = Interrupted(pt.VirtualStage.of(PLAYS, limits=(0.0, 75.0)))
    with pytest.raises(KeyboardInterrupt):
        pt.measure(used, "sine:1Hz,0..75V,3s", rate=100.0, rest=5.0)
    assert (used.held, used.holds) == (5.0, 2)
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_range_the_wrong_way_round_is_refused_in_volts() -> None:
    for text in ("sine:1Hz,10..0V,2s", "chirp:1..5Hz,10..0V,2s", "decaying:1Hz,10..0V"):
        with pytest.raises(pt.ParameterError, match="low is 10 V: expected less than high, 0 V"):
            pt.hardware.parse_drive(text)


@pytest.mark.parametrize(
    "text",
    [
        "sine:60Hz,0..10V,2s",
        "triangle:60Hz,0..10V,2s",
        "decaying:60Hz,0..10V,2s",
        "chirp:1..60Hz,0..10V,2s",
        "multisine:1/60Hz,0..10V,2s",
    ],
)
def test_a_drive_above_half_the_rate_is_refused(text: str) -> None:
    drive = pt.hardware.parse_drive(text)
    assert "60 Hz" in str(drive) or "multisine" in str(drive)
    with pytest.raises(pt.ParameterError, match="60 Hz: expected at most half the rate, 50 Hz"):
        pt.measure(pt.hardware.connect("virtual:"), drive, rate=100.0)
    assert np.ptp(drive.sample(1.0 / 1000.0)) > 5.0


@pytest.mark.slow
def test_dead_zones_that_were_placed_too_early_are_placed_anew() -> None:
    """With this noise they moved, before the creep was known, and did not come back."""
    used = VirtualDevice(pt.VirtualStage.xu_li_2010(seed=11))
    used.hold(0.0)
    log = pt.measure(used, "decaying:1Hz,0..75V", rate=1000.0)
    fit = pt.identify(log, "prandtl-ishlinskii")
    # The noise is 97 nm; it was 167 nm.
    assert fit.cost < 110e-9
