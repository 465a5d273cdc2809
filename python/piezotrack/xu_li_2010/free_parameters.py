"""Free parameters of the calibration, and the virtual stage that they make."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..identification.experiments.step_readings import StepReadings
from ..stages.plays.prandtl_ishlinskii import PrandtlIshlinskiiStage
from ..stages.virtual import VirtualStage
from ..stages.xy import XYStage
from .apparatus import Apparatus
from .experiments import fig_04_step_test

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["FREE", "SEED", "Free", "apparatus_at", "theta_at"]


@dataclass(frozen=True)
class Free:
    """A free parameter and its bounds, SI.

    If `scaled`, the search is on a logarithmic scale.
    """

    name: str
    low: float
    high: float
    meaning: str
    scaled: bool = False

    def at(self, part: float) -> float:
        """Value at this part of the range, 0 to 1."""
        if self.scaled:
            return float(self.low * (self.high / self.low) ** part)
        return self.low + part * (self.high - self.low)

    def part(self, value: float) -> float:
        """Position of a value in the range, 0 to 1: the inverse of `at`."""
        if self.scaled:
            return float(np.log(value / self.low) / np.log(self.high / self.low))
        return (value - self.low) / (self.high - self.low)

    def about(self, value: float, share: float) -> Free:
        """Bounds of a later round: this share of the range, about the value found before."""
        middle = self.part(value)
        low, high = max(middle - 0.5 * share, 0.0), min(middle + 0.5 * share, 1.0)
        return replace(self, low=self.at(low), high=self.at(high))


def _of_each_axis() -> list[Free]:
    """List the parameters of each axis."""
    return [
        Free(f"{one.name}_{axis}", one.low, one.high, f"{axis}: {one.meaning}", one.scaled)
        for axis in "xy"
        for one in (
            Free("share", 0.1, 0.25, "widest loop of the plays, of the travel"),
            Free("slope", 0.0, 3.0, "weights of the plays grow with the threshold to this power"),
            Free("reach", 0.6, 1.0, "largest threshold, of half the swing"),
            Free("bend", -0.25, 0.1, "asymmetry: above 25 V the slope grows by this"),
            Free("top", -0.25, 0.1, "asymmetry: above 50 V the slope grows by this"),
            Free("creep_fast", 0.0, 0.04, "share of the fastest creep"),
            Free(
                "creep_fast_time", 0.02, 0.2, "time constant of the fastest creep [s]", scaled=True
            ),
            Free("creep_1s", 0.0, 0.015, "share of the creep of 1 s"),
            Free("creep_10s", 0.0, 0.015, "share of the creep of 10 s"),
            Free("frequency", 158.0, 172.0, "frequency of the mode [Hz]"),
            Free("damping_ratio", 0.05, 0.08, "damping ratio of the mode"),
        )
    ]


FREE = (
    *_of_each_axis(),
    Free("end_y", 105e-6, 122e-6, "y: displacement at 75 V [m]"),
    Free("bandwidth", 200.0, 2000.0, "bandwidth of the amplifier [Hz]", scaled=True),
    Free("slew", 3e4, 3e5, "slew rate of the amplifier [V/s]", scaled=True),
    Free("delay", 0.0, 1.5e-3, "delay from a reading to the effect of its voltage [s]"),
    Free("jitter", 0.0, 0.5e-3, "mean sampling jitter [s]"),
    Free("lag", 0.0, 0.06, "lag from sampling x to sampling y [s]"),
    Free("noise_bandwidth", 20.0, 500.0, "bandwidth of the sensor noise [Hz]", scaled=True),
    Free("cross_xy", -0.015, 0.015, "share of y in x; at most 1.5 % is published"),
    Free("cross_yx", -0.015, 0.015, "share of x in y"),
)
# 2e-4 s in place of 2e-5: no number changes by more than 0.04 um, except a peak of noise, the
# largest error of feedforward and PID: by 0.11 of 2.1 um.
STEP = 2e-4
# Seed of sensors and searches.
SEED = 1


def theta_at(place: Sequence[float], box: Sequence[Free] = FREE) -> dict[str, float]:
    """Return the parameters, SI, of a candidate in the unit box."""
    return {free.name: free.at(part) for free, part in zip(box, place, strict=True)}


def apparatus_at(theta: Mapping[str, float]) -> Apparatus:
    """Make the apparatus with these free parameters.

    The gain of each axis follows from its displacement at 75 V, which is published for x.
    """
    end_x = StepReadings.xu_li_2010().steady_state
    x = _axis(theta, "x", end_x)
    y = _axis(theta, "y", theta["end_y"])
    stage = XYStage(x=x, y=y, cross_talk=(theta["cross_xy"], theta["cross_yx"]), lag=theta["lag"])
    found = Apparatus(stage=stage, delay=theta["delay"], jitter=theta["jitter"])
    return found.seeded(SEED)


def _axis(theta: Mapping[str, float], axis: str, end: float) -> VirtualStage:
    known = VirtualStage.xu_li_2010()
    of_axis = {key.removesuffix(f"_{axis}"): value for key, value in theta.items()}
    # Of unit gain, in um.
    trial = replace(
        known,
        stage=_plays(of_axis, 1e-6),
        amplifier=replace(known.amplifier, bandwidth=theta["bandwidth"], slew=theta["slew"]),
        sensor=replace(known.sensor, noise_bandwidth=theta["noise_bandwidth"]),
        step=STEP,
    )
    return replace(trial, stage=_plays(of_axis, 1e-6 * end / _end(trial)))


def _plays(theta: Mapping[str, float], gain: float) -> PrandtlIshlinskiiStage:
    """Make plays, creep and mode of an axis, of a mean gain [m/V]."""
    known = VirtualStage.xu_li_2010()
    assert isinstance(known.stage, PrandtlIshlinskiiStage)
    assert known.preconditioning is not None
    swing = known.preconditioning.swing
    places = theta["reach"] * np.array(known.stage.thresholds)
    # In the middle of a settled swing the branches of a play are min(2 r, swing - 2 r) apart, and
    # its output travels swing - 2 r: the widest loop is `share`, the mean slope 1.
    shape = (places / places.max()) ** theta["slope"]
    weights = (
        theta["share"]
        * swing
        * shape
        / float(np.sum(shape * np.minimum(2 * places, swing - 2 * places)))
    )
    passed = float(np.sum(weights * (1.0 - 2.0 * places / swing)))
    return PrandtlIshlinskiiStage(
        linear=gain * (1.0 - passed),
        thresholds=tuple(places),
        weights=tuple(gain * weights),
        dead_zone_thresholds=(gain * swing / 3.0, gain * 2.0 * swing / 3.0),
        dead_zone_weights=(theta["bend"], theta["top"]),
        creep_weights=(theta["creep_fast"], theta["creep_1s"], theta["creep_10s"]),
        creep_times=(theta["creep_fast_time"], 1.0, 10.0),
        frequency=theta["frequency"],
        damping_ratio=theta["damping_ratio"],
    )


def _end(stage: VirtualStage) -> float:
    """Return the displacement 0.3 s after a step to 75 V [m], as in the step test."""
    u = np.full(300, fig_04_step_test.VOLTS)
    return float(stage.simulate(u, 1e-3, hold="zoh").x[-100:].mean())
