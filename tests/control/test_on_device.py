"""Controllers on devices: tables that are played and learnt, and the loop closed point by point."""

from __future__ import annotations

import math
import os
import signal
import threading
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from misbehaving import misbehaving
from piezotrack.control.on_device import latency
from piezotrack.hardware import VirtualDevice

if TYPE_CHECKING:
    from collections.abc import Callable

PLAYS = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0, 15.0), weights=(4e-7, 3e-7))
LIMITS = (0.0, 75.0)
NOISE = 5e-9
LOOP = pt.Controller(
    dt=0.03, limits=LIMITS, feedback=pt.Pid.from_um(kp=0.1, ti=0.018), max_jump=20e-6
)
SINE = pt.sine(frequency=0.5, low=20e-6, high=60e-6, duration=2.0)


def stage(**others: Any) -> pt.VirtualStage:
    return pt.VirtualStage.of(PLAYS, noise=NOISE, limits=LIMITS, **others)


def feedforward(dt: float = 1e-3, **others: Any) -> pt.Controller:
    return pt.Controller(dt=dt, limits=LIMITS, feedforward=PLAYS.inverse(), **others)


@pytest.fixture
def _short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short measurements of the latency, and none refused: the machine of a test is busy."""
    monkeypatch.setattr(latency, "FEWEST", 5)
    monkeypatch.setattr(latency, "LONGEST", 0.2)
    monkeypatch.setattr(latency, "MOST", 1e3)


RUNS: dict[str, Callable[[], Any]] = {
    "simulated": lambda: pt.track(stage(), feedforward(), SINE),
    "played": lambda: pt.play(VirtualDevice(stage()), feedforward(), SINE),
    "looped": lambda: pt.track(VirtualDevice(stage()), LOOP, SINE, beyond_reach=True),
}


@pytest.mark.usefixtures("_short")
@pytest.mark.parametrize("kind", RUNS)
def test_a_reference_is_sampled_once(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also on a device, whose record is collected along the same samples."""
    sample, calls = pt.Reference.sample, []

    def counted(reference: pt.Reference, dt: float) -> Any:
        calls.append(dt)
        return sample(reference, dt)

    monkeypatch.setattr(pt.Reference, "sample", counted)
    run = RUNS[kind]()
    assert calls == [run.controller.dt]


# Tables.


def test_a_played_inverse_is_late_by_the_sample_in_which_a_voltage_shows() -> None:
    rate = 2000.0
    reference = pt.triangle(frequency=5.0, low=20e-6, high=80e-6, duration=1.0)
    run = pt.play(VirtualDevice(stage()), PLAYS.inverse(), reference, rate=rate)
    # 600 um/s for a sample, but near the turns.
    assert run.metrics.max_error == pytest.approx(600e-6 / rate, abs=10 * NOISE)
    assert np.array_equal(run.measured, run.displacement)
    assert "played on virtual amplifier" in run.note


def test_what_is_learnt_on_a_device_takes_that_away() -> None:
    reference = pt.triangle(frequency=5.0, low=20e-6, high=80e-6, duration=1.0)
    device = VirtualDevice(stage(mode=(300.0, 0.1)))
    found = pt.learn(device, reference, feedforward(), model=stage(mode=(310.0, 0.1)), trials=10)
    assert found.convergence.monotone
    assert found.errors[found.best] < 0.1 * found.errors[0]
    assert device.held == 0.0


class Ending(VirtualDevice):
    """Ends its third play in the middle of the table, as a function does."""

    def __init__(self, end: Callable[[], None]) -> None:
        super().__init__(stage())
        self.end, self.plays = end, 0

    def play(self, volts: Any, rate: float, *, lead_in: float = 0.0) -> Any:
        made = super().play(volts, rate, lead_in=lead_in)
        self.plays += 1
        if self.plays == 3:
            self.hold(40.0)
            self.end()
        return made


def _lost_samples() -> None:
    raise pt.DataError("the record has 90 of 200 samples without a reading")


@pytest.mark.parametrize(
    ("end", "kind"),
    [
        (lambda: _broken(0.0), pt.DeviceError),
        (_lost_samples, pt.DataError),
        (lambda: os.kill(os.getpid(), signal.SIGINT), pt.Interrupted),
        (lambda: os.kill(os.getpid(), signal.SIGTERM), pt.Interrupted),
    ],
)
def test_a_learning_that_ends_early_ends_at_rest_and_has_what_was_learnt(
    end: Callable[[], None], kind: type[Any]
) -> None:
    reference = pt.triangle(frequency=5.0, low=20e-6, high=80e-6, duration=1.0)
    device, before = Ending(end), signal.getsignal(signal.SIGTERM)
    with pytest.raises(kind) as caught:
        pt.learn(device, reference, feedforward(), model=stage(mode=(310.0, 0.1)), rest=3.0)
    assert device.held == 3.0
    assert signal.getsignal(signal.SIGTERM) is before
    learning = caught.value.partial
    assert (len(learning.trials), learning.best, learning.stopped) == (2, 1, "interrupted")
    assert learning.tables.shape == (2, 200)
    assert learning.errors[1] < 0.6 * learning.errors[0]
    assert learning.final.metrics.rms_error < learning.first.metrics.rms_error


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda d: pt.play(d, LOOP, SINE), ("controller has feedback", "pt.track")),
        (lambda d: pt.play(d, PLAYS.inverse(), SINE), ("rate is not given",)),
        (lambda d: pt.play(d, feedforward(), SINE, rate=1e3), ("rate is 1000.0: expected none",)),
        (
            lambda d: pt.play(d, pt.Controller(dt=1e-3, limits=LIMITS), SINE),
            ("controller has no feedforward",),
        ),
        (
            lambda d: pt.play(
                d, pt.Controller(dt=1e-3, limits=(0.0, 90.0), feedforward=PLAYS.inverse()), SINE
            ),
            ("limits of the controller are 0 to 90 V", "0 to 75 V"),
        ),
        (lambda d: pt.play(d, feedforward(1e-6), SINE), ("rate is 1e+06 Hz", "100000 Hz")),
        (lambda d: pt.learn(d, SINE, LOOP, model=stage()), ("controller has feedback",)),
        (
            lambda d: pt.learn(d, SINE, pt.Controller(dt=1e-3, limits=LIMITS)),
            ("model is not given",),
        ),
        (lambda d: pt.learn(d, SINE, feedforward(), rest=80.0), ("rest is 80 V", "0 to 75 V")),
        (
            lambda d: pt.learn(d, SINE, feedforward(), timing=pt.Timing(voltages_before=[9.0])),
            ("timing has jitter or voltages_before", "device"),
        ),
        (lambda _: pt.learn(stage(), SINE, feedforward(), rest=0.0), ("rest is 0.0", "simulated")),
        (
            lambda d: pt.track(d, LOOP, SINE, timing=pt.Timing(jitter=0.1)),
            ("timing", "on a device"),
        ),
        (lambda d: pt.track(d, LOOP, SINE, safe=-5.0), ("rest is -5 V", "0 to 75 V")),
        (lambda _: pt.track(stage(), LOOP, SINE, safe=0.0), ("safe is 0.0", "simulated")),
    ],
)
def test_what_a_device_cannot_do_is_refused_before(
    call: Callable[[VirtualDevice], object], words: tuple[str, ...]
) -> None:
    device = VirtualDevice(stage())
    with pytest.raises(pt.ParameterError) as caught:
        call(device)
    for word in words:
        assert word in str(caught.value)
    assert device.held == 0.0


# The loop closed point by point.


class Slow(VirtualDevice):
    """Takes half of an interval of 20 ms for an exchange, by a clock of its own."""

    def exchange(self, volts: float) -> float:
        reading = super().exchange(volts)
        pause = threading.Event()
        pause.wait(0.01)
        return reading


def test_a_device_too_slow_for_the_interval_is_refused_in_words() -> None:
    device = Slow(stage())
    loop = pt.Controller(dt=0.02, limits=LIMITS, feedback=pt.Pid.from_um(kp=0.1, ti=0.2))
    with pytest.raises(pt.ParameterError) as caught:
        pt.track(device, loop, SINE)
    assert "dt of the controller is 20 ms: expected" in str(caught.value)
    assert "99th percentile" in str(caught.value)
    assert device.held == 0.0


@pytest.mark.usefixtures("_short")
def test_the_loop_follows_and_says_how_late_it_was() -> None:
    device = VirtualDevice(stage())
    run = pt.track(device, LOOP, SINE, safe=3.0)
    assert isinstance(run, pt.control.DeviceTracking)
    assert run.t.size == run.lateness.size == 67
    # The integrator brings it to the reference; without it nothing would move.
    assert np.std(run.error[33:]) < 0.5 * np.std(run.desired[33:])
    assert run.overruns <= 67
    assert "lateness" in run.summary()
    assert device.held == 3.0


@pytest.mark.usefixtures("_short")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_ends_safe_when_it_is_interrupted(number: signal.Signals) -> None:
    device = VirtualDevice(stage())
    before = signal.getsignal(signal.SIGTERM)
    later = threading.Timer(1.2, os.kill, (os.getpid(), number))
    later.start()
    with pytest.raises(pt.Interrupted) as caught:
        pt.track(device, LOOP, pt.sine(frequency=0.5, low=20e-6, high=60e-6, duration=60.0))
    assert device.held == 0.0
    assert caught.value.partial is None or caught.value.partial.t.size < 1200
    assert signal.getsignal(signal.SIGTERM) is before


class Failing(VirtualDevice):
    """Answers with something else from a reading on, as a function says."""

    def __init__(self, answer: Callable[[float], Any], *, after: int = 25) -> None:
        super().__init__(stage())
        self.answer, self.after, self.readings = answer, after, 0

    def exchange(self, volts: float) -> Any:
        self.readings += 1
        reading = super().exchange(volts)
        return self.answer(reading) if self.readings > self.after else reading

    def hold(self, volts: float) -> None:
        VirtualDevice.exchange(self, volts)


class Jumps:
    """Adds 5 mm and takes it away, in turn."""

    def __init__(self) -> None:
        self.by = 5e-3

    def __call__(self, reading: float) -> float:
        self.by = -self.by
        return reading + self.by


def _broken(_: float) -> float:
    raise pt.DeviceError("the connection was lost")


@pytest.mark.slow
@pytest.mark.usefixtures("_short")
@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda _: math.nan, "readings in a row are no measurements, at .* not finite"),
        (lambda _: "nothing", "no measurements, at .* not finite"),
        (lambda _: 1.0, "no measurements, at .* outside of the span"),
        (Jumps(), "no measurements, at .* too far from the last"),
        (lambda _: 30e-6, "stands still at 30 um since 20 samples, .* the sensor is stale"),
        (_broken, "the connection was lost"),
    ],
)
def test_a_fault_of_the_device_ends_the_loop_safe(
    answer: Callable[[float], Any], words: str
) -> None:
    device = Failing(answer)
    reference = pt.sine(frequency=0.5, low=20e-6, high=60e-6, duration=2.5)
    with pytest.raises(pt.DeviceError, match=words) as caught:
        pt.track(device, LOOP, reference)
    assert device.held == 0.0
    # What was tracked before the fault is kept.
    assert caught.value.partial is not None
    assert 2 <= caught.value.partial.t.size < 75
    # It ends before the period that counts in a whole run, and can be read all the same.
    assert caught.value.partial.settled == 0.0
    assert "Tracking" in repr(caught.value.partial)
    assert caught.value.partial.summary()


class Hanging(VirtualDevice):
    """Takes some seconds for one exchange, or for each from then on."""

    def __init__(self, pause: float, *, each: bool) -> None:
        super().__init__(stage())
        self.pause, self.each, self.readings = pause, each, 0

    def exchange(self, volts: float) -> float:
        self.readings += 1
        if self.readings == 25 or (self.each and self.readings > 25):
            threading.Event().wait(self.pause)
        return super().exchange(volts)

    def hold(self, volts: float) -> None:
        VirtualDevice.exchange(self, volts)


@pytest.mark.slow
@pytest.mark.usefixtures("_short")
@pytest.mark.parametrize(
    ("pause", "each", "words"),
    [(0.6, False, "the device hangs, or the computer"), (0.1, True, "too slow for an interval of")],
)
def test_a_device_that_hangs_or_gets_slow_ends_the_loop_safe(
    pause: float, each: bool, words: str
) -> None:
    device = Hanging(pause, each=each)
    reference = pt.sine(frequency=0.5, low=20e-6, high=60e-6, duration=6.0)
    with pytest.raises(pt.DeviceError, match=words):
        pt.track(device, LOOP, reference)
    assert device.held == 0.0


@pytest.mark.usefixtures("_short")
def test_an_output_that_cannot_be_led_back_is_said_to_be_where_it_was() -> None:
    class Lost(Failing):
        def hold(self, volts: float) -> None:
            if self.readings > self.after:
                raise pt.DeviceError("the connection was lost")
            super().hold(volts)

    device = Lost(lambda y: y)
    with pytest.raises(
        pt.DeviceError, match=r"could not be led to 0 V .* may still be at"
    ) as caught:
        pt.track(device, LOOP, SINE)
    assert f"{device.held:.4g} V" in str(caught.value)


# Each fault of an instrument in another process, and how the loop ends: in a sentence, or, where
# one reading tells nothing (a clipped output, a short jump), as a run that shows it.
ENDS = {
    "stale": "stands still",
    "silent": "did not answer",
    "nan": "not finite",
    "half": "no end of line within 1 s",
    "drop": "closed|connection",
    "nm": "outside of the span|too far from the last",
    "nm unit": "nm",
    "garbage": "busy",
}


@pytest.mark.slow
@pytest.mark.usefixtures("_short")
@pytest.mark.parametrize("fault", list(ENDS))
def test_an_instrument_that_misbehaves_ends_safe(fault: str) -> None:
    reference = pt.sine(frequency=0.5, low=20e-6, high=60e-6, duration=2.5)
    with misbehaving(fault, after=40) as (host, port):
        device = pt.hardware.connect(f"scpi://{host}:{port}?unit=um&limits=0..75V&timeout=1s")
        with pytest.raises(pt.DeviceError, match=ENDS[fault]):
            pt.track(device, LOOP, reference)
        device.close()
