"""The axis of a virtual controller: a virtual stage on a servo clock, brought up to date lazily."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING

import numpy as np

from ....errors import ParameterError
from ....hardware.device import Rates
from ....hardware.virtual import VirtualDevice
from .generator import Generator, Recorder, Samples

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ....stages.virtual import VirtualStage

    Array = NDArray[np.float64]

__all__ = ["CLOCK", "UM", "VirtualAxis"]

# Servo cycles in a second, and um in a metre.
CLOCK = 20e3
UM = 1e6
# Servo cycles between two steps of the servo, and its bandwidth [rad/s]: below what the damping of
# a mode of 160 Hz with zeta = 0.065 allows an integrator, 2 zeta omega = 130 rad/s.
SERVO_STEP, BANDWIDTH = 20, 30.0
# Longest step of a stage under way [cycles], which is also how old a reading may be.
LONGEST_STEP = 100
# Share of the travel within which a target is reached.
ON_TARGET = 0.005
# Decimals of the travel [um], so that its ends are in it as they are written.
DIGITS = 3
# Time and points of the way to rest [cycles].
WAY, WAY_POINTS = round(0.5 * CLOCK), 250
# Longest time after a change that is simulated [cycles]: what still creeps after a minute creeps no
# further. With the servo on, which settles in a fraction of a second, less.
LONGEST_REST, LONGEST_SERVO = round(60.0 * CLOCK), round(2.0 * CLOCK)
# Longest time that is simulated at once while table or recorder run [cycles]: half a second's work.
MOST, MOST_WITH_SERVO = round(120.0 * CLOCK), round(10.0 * CLOCK)
# Most samples that are simulated in one piece.
PIECE = 500_000


class VirtualAxis:
    """A virtual stage with a servo, a wave generator and a data recorder.

    Time goes in servo cycles. Whoever asks something calls `catch_up` first.

    Parameters
    ----------
    stage : VirtualStage
        The stage.
    limits : (float, float)
        Lowest and highest voltage [V].
    speed : float
        How much faster than the computer's clock the stage's time goes.
    clock : callable
        The computer's clock [s].
    """

    def __init__(
        self,
        stage: VirtualStage,
        limits: tuple[float, float],
        speed: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        low, high = limits
        self.limits = limits
        # Where the stage comes to rest at the limits [um].
        ends = [UM * _rest(stage, volts) for volts in limits]
        self.travel = round(min(ends), DIGITS), round(max(ends), DIGITS)
        self._slope = (ends[1] - ends[0]) / (high - low)
        if not (math.isfinite(self._slope) and self._slope):
            raise ParameterError(
                "stage",
                f"at {ends[0]:g} um at {low:g} V and at {ends[1]:g} um at {high:g} V",
                "one that moves",
                verb="rests",
            )
        self._speed, self._clock = speed, clock
        self._now = 0.0
        self._device = VirtualDevice(
            stage,
            limits=limits,
            rates=Rates(lowest=1e-3, highest=CLOCK),
            clock=lambda: self._now,
        )
        # Servo cycles up to which the stage has come, and those since something was changed.
        self._begun, self._done, self._since = clock(), 0, 0
        self.servo = False
        self.generator: Generator | None = None
        self.recorder = Recorder(start=0, rate=1, points=0)
        # The stage of a new device is at 0 V.
        self.voltage = self.control = min(max(0.0, low), high)
        self.position = self.target = 0.0
        self._put(self.control)

    @property
    def moving(self) -> bool:
        """Whether the generator runs, or the servo is under way to its target."""
        return self.generator is not None or not self.on_target

    @property
    def on_target(self) -> bool:
        """Whether the target is reached; with the servo off always."""
        near = ON_TARGET * (self.travel[1] - self.travel[0])
        return not self.servo or abs(self.position - self.target) <= near

    def catch_up(self) -> None:
        """Bring the stage to the present."""
        present = math.floor((self._clock() - self._begun) * self._speed * CLOCK)
        most = MOST_WITH_SERVO if self.servo else MOST
        if (self.generator or self.recorder.active) and present - self._done > most:
            # The computer does not keep up: what cannot be simulated has not been.
            self._begun += (present - self._done - most) / (self._speed * CLOCK)
            present = self._done + most
        while (cycles := present - self._done) > 0:
            if self._at_rest:
                self._rest(cycles)
            elif not self._step(cycles):
                return

    def set_control(self, volts: float) -> None:
        """Put out a voltage with the servo off."""
        self.control, self._since = volts, 0
        self._put(volts)

    def set_target(self, target: float) -> None:
        """Move to a position [um] with the servo on."""
        self.target, self._since = target, 0

    def set_servo(self, on: bool) -> None:
        """Switch the servo, without a jump: at the present position, or the present voltage."""
        if on and not self.servo:
            self.target = self.position
        self.servo, self._since = on, 0
        self.control = self.voltage

    def start(
        self, table: Array, *, rate: int, repetitions: int, interpolated: bool, offset: float
    ) -> int:
        """Start the generator at the next point of its clock; return that servo cycle."""
        start, self._since = self._done + rate, 0
        self.generator = Generator(
            table=table + offset,
            rate=rate,
            start=start,
            repetitions=repetitions,
            interpolated=interpolated,
        )
        return start

    def record(self, rate: int, points: int, start: int | None = None) -> None:
        """Start the recorder anew, now or at a servo cycle."""
        first = self._done + rate if start is None else start
        self.recorder = Recorder(start=first, rate=rate, points=points)

    def stop(self) -> None:
        """Stop generator and motion, where the stage is."""
        self.generator, self._since = None, 0
        self.target = self.position
        self.control = self.voltage

    def lead_to_rest(self) -> None:
        """Lead the output to 0 V, or the limit nearest to it, with the servo off."""
        self.stop()
        self.set_servo(False)
        low, high = self.limits
        way = np.linspace(self.voltage, min(max(0.0, low), high), WAY_POINTS)
        self.start(way, rate=WAY // WAY_POINTS, repetitions=1, interpolated=False, offset=0.0)

    @property
    def _at_rest(self) -> bool:
        return not (self.servo or self.generator or self.recorder.active)

    def _put(self, volts: float) -> None:
        """Put out a voltage now."""
        self.position = UM * self._device.exchange(volts)
        self.voltage = volts

    def _rest(self, cycles: int) -> None:
        """Hold the voltage for some servo cycles."""
        self._now += min(cycles, max(0, LONGEST_REST - self._since)) / CLOCK
        self._put(self.voltage)
        self._done += cycles
        self._since += cycles

    def _step(self, cycles: int) -> int:
        """Go on in even steps, up to the next event; return their number."""
        rates, events = [], []
        if one := self.generator:
            rates += [one.step, abs(one.start - self._done)]
            events += [] if one.end is None else [one.end]
        if self.recorder.active:
            rates += [self.recorder.rate, abs(self.recorder.start - self._done)]
            events.append(self.recorder.end)
        if not rates:
            # A servo that has rested for long need not be followed through all of it.
            skipped = max(0, cycles - max(SERVO_STEP, LONGEST_SERVO - self._since))
            self._done += skipped
            self._since += skipped
            cycles -= skipped
        step = _divided(math.gcd(*rates)) if rates else SERVO_STEP
        until = [event - self._done for event in events if event > self._done]
        count = min([cycles, *until]) // step
        count = min(count, PIECE)
        if count:
            at = self._done + step * np.arange(1, count + 1, dtype=np.int64)
            self._take(self._through(at, step))
        return count

    def _through(self, at: NDArray[np.int64], step: int) -> Samples:
        """Move the stage through even steps to some servo cycles."""
        before = self.target if self.servo else self.control
        wanted = np.full(at.size, before)
        if self.generator is not None:
            wanted = self.generator.at(at, before)
        rate = CLOCK / step
        if not self.servo:
            volts = np.clip(wanted, *self.limits)
            y = UM * self._device.play(volts, rate).displacement
            return Samples(cycles=at, target=y, position=y, voltage=volts, control=wanted)
        low, high = self.limits
        gain = BANDWIDTH / rate / self._slope
        volts, y = np.empty(at.size), np.empty(at.size)
        now, seen = self.voltage, self.position
        for k, target in enumerate(wanted):
            now = min(max(now + gain * (target - seen), low), high)
            seen = UM * float(self._device.play(np.array([now]), rate).displacement[0])
            volts[k], y[k] = now, seen
        self.target = float(wanted[-1])
        return Samples(cycles=at, target=wanted, position=y, voltage=volts, control=volts)

    def _take(self, seen: Samples) -> None:
        """Take over where the stage has come to."""
        if self.recorder.active:
            self.recorder.take(seen)
        last = int(seen.cycles[-1])
        self._since += last - self._done
        self._done = last
        self.position, self.voltage = float(seen.position[-1]), float(seen.voltage[-1])
        if not self.servo:
            self.control = float(seen.control[-1])
        if (one := self.generator) and one.end is not None and self._done >= one.end:
            self.generator, self._since = None, 0


def _divided(step: int) -> int:
    """Return the largest even part of a step that is not too long for servo and readings."""
    return next(part for part in range(min(step, LONGEST_STEP), 0, -1) if step % part == 0)


def _rest(stage: VirtualStage, volts: float) -> float:
    """Return the mean displacement [m] at which a stage comes to rest under a voltage."""
    interval, length, mean = 1e-3, 3.0, 0.5
    run = stage.simulate(np.full(round(length / interval), volts), interval, hold="zoh")
    return float(run.y[-round(mean / interval) :].mean())
