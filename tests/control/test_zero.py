"""A stage and a model with different zeros: read, met, and named where a motion is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.control.on_device import latency

PLAYS = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(5e-7,))
LIMITS = (0.0, 75.0)
LINE = pt.triangle(frequency=2.0, low=10e-6, high=60e-6, duration=1.0)


@pytest.fixture(autouse=True)
def _a_short_measurement_of_the_latency(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(latency, "FEWEST", 5)
    monkeypatch.setattr(latency, "TICKS", 5)


def stage(offset: float, noise: float = 0.0) -> pt.VirtualStage:
    return pt.VirtualStage(stage=PLAYS, sensor=pt.stages.Sensor(offset=offset, noise=noise, seed=1))


def device(offset: float) -> pt.hardware.VirtualDevice:
    return pt.hardware.VirtualDevice(stage(offset, noise=20e-9), limits=LIMITS)


def controller(offset: float = 3e-6, **parts: object) -> pt.Controller:
    """Of a model whose log had another zero."""
    forward = replace(PLAYS.inverse(), offset=offset)
    return pt.Controller(dt=1e-3, limits=LIMITS, feedforward=forward, **parts)  # type: ignore[arg-type]


def test_the_zero_of_a_device_is_its_reading_at_rest() -> None:
    assert pt.zero(device(-112e-6)) == pytest.approx(-112e-6, abs=10e-9)
    # Of a simulated stage it is exact.
    assert pt.zero(stage(-112e-6, noise=20e-9)) == -112e-6
    assert pt.zero(device(0.0), rest=10.0) == pytest.approx(1e-6 * 10.0 + 0.5e-6 * 5.0, abs=30e-9)
    with pytest.raises(pt.ParameterError, match="rest is 80 V at sample 0: expected 0 to 75 V"):
        pt.zero(device(0.0), rest=80.0)
    with pytest.raises(pt.ParameterError, match="duration is 0"):
        pt.zero(device(0.0), duration=0.0)


@pytest.mark.parametrize("offset", [-112e-6, 0.0, 40e-6])
def test_a_loop_is_the_same_on_a_stage_of_any_zero(offset: float) -> None:
    loop = controller(feedback=pt.Pid.from_um(kp=0.05, ti=0.01))
    alike = pt.track(stage(3e-6), loop, LINE)
    other = pt.track(stage(offset), loop, LINE, offset=pt.zero(stage(offset)))
    assert np.allclose(alike.measured, other.measured, rtol=0.0, atol=1e-15)
    assert np.allclose(alike.voltage, other.voltage, rtol=0.0, atol=1e-9)


def test_a_table_and_a_loop_on_a_device_meet_its_zero() -> None:
    there = device(-112e-6)
    run = pt.play(there, controller(), LINE, offset=pt.zero(there))
    assert abs(run.metrics.mean_error) < 50e-9
    assert "readings less -115 um" in run.note
    # Without it the readings are as they come.
    assert pt.play(there, controller(), LINE).metrics.mean_error == pytest.approx(115e-6, rel=1e-3)
    slow = replace(controller(feedback=pt.Pid.from_um(kp=0.02, ti=0.06)), dt=0.05)
    tracked = pt.track(there, slow, "sine:1Hz,10..60um,1s", offset=pt.zero(there), unstable=True)
    # A tick of 50 ms makes some 20 um at this rate, the zeros would 115 um.
    assert tracked.metrics.max_error < 30e-6


@pytest.mark.parametrize("offset", [112.0, float("nan"), "112um"])
def test_an_offset_that_is_none_is_refused(offset: float) -> None:
    with pytest.raises((pt.ParameterError, TypeError), match="offset"):
        pt.track(stage(0.0), controller(), LINE, offset=offset)


class Counting(pt.hardware.VirtualDevice):
    """A device that keeps what it was told to put out."""

    def __init__(self) -> None:
        super().__init__(stage(0.0, noise=20e-9), limits=LIMITS)
        self.put_out: list[float] = []

    def hold(self, volts: float) -> None:
        self.put_out.append(volts)
        super().hold(volts)


def test_a_slow_loop_is_led_to_rest_in_small_steps() -> None:
    there = Counting()
    slow = replace(controller(feedback=pt.Pid.from_um(kp=0.02, ti=0.3)), dt=0.2)
    run = pt.track(there, slow, "sine:0.5Hz,10..60um,1.2s", unstable=True)
    assert run.voltage[-1] > 30.0
    steps = np.abs(np.diff(there.put_out[there.put_out.index(run.voltage[-1]) :]))
    assert there.put_out[-1] == 0.0
    # Half a second from there, as fast as the device answers, not in three steps of the loop.
    assert steps.max() < 0.1 * run.voltage[-1]


def test_a_motion_refused_for_the_zeros_names_both() -> None:
    words = (
        r"only because the zeros differ: the stage rests at -112 um, the model .* at 3 um: .*zero"
    )
    with pytest.raises(pt.ParameterError, match=words):
        pt.track(stage(-112e-6), controller(), LINE)
    # A motion that is too large from any zero is not.
    with pytest.raises(pt.ParameterError, match="beyond") as caught:
        pt.track(stage(-112e-6), controller(), "triangle:2Hz,10..160um,1s")
    assert "zeros differ" not in str(caught.value)


def test_a_model_with_an_offset_is_within_its_own_reach_on_a_device() -> None:
    """Checks before a loop begins know the offset of the feedforward."""
    there = device(-112e-6)
    slow = replace(controller(offset=-112e-6, feedback=pt.Pid.from_um(kp=0.02, ti=0.06)), dt=0.05)
    run = pt.track(there, slow, "sine:1Hz,-102..-52um,1s", unstable=True)
    assert run.metrics.max_error < 30e-6


def test_a_table_is_learnt_from_the_zero_of_a_device() -> None:
    there = device(-112e-6)
    options = {"trials": 3, "mode_scales": 1.0, "cutoff": 50.0}
    learnt = pt.learn(there, LINE, controller(), offset=pt.zero(there), **options)  # type: ignore[arg-type]
    assert learnt.errors[0] < 1e-6
    alike = pt.learn(stage(3e-6), LINE, controller(), **options)  # type: ignore[arg-type]
    met = pt.learn(stage(-112e-6), LINE, controller(), offset=-112e-6, **options)  # type: ignore[arg-type]
    assert np.allclose(met.table, alike.table, rtol=0.0, atol=1e-9)
