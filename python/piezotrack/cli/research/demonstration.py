"""The demonstration: a model of a measured log, judged on another, and tracking with it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ...control.controller.controller import Controller
from ...control.laws.pid import Pid
from ...control.running.track import track
from ...data import datasets
from ...data.dataset import Dataset
from ...identification.fit import identify
from ...identification.methods.descents import Descents
from ...references.waveforms import triangle
from ...stages.plays.prandtl_ishlinskii import PrandtlIshlinskiiStage
from ...stages.virtual import VirtualStage

if TYPE_CHECKING:
    from ...control.loop.tracking import Tracking
    from ...identification.fitted.identification import Identification
    from ...identification.fitted.score import Score
    from ...stages.inverse import Inverse

__all__ = [
    "FEEDBACK",
    "NOISE",
    "REFERENCE",
    "WINDOW",
    "Demonstration",
    "demo_logs",
    "run_demo",
]

# Seconds of the log that the model is fitted to, and from which the other one is scored.
WINDOW = (3.0, 23.0)
# As a text for `--reference`.
REFERENCE = "triangle:1Hz,5..42um"
# Of the sensor, from the parts of the other log in which the stage is at rest [m].
NOISE = 65e-9
FEEDBACK = Pid.from_um(kp=0.03, ti=0.02, td=0.0)


@dataclass(frozen=True, kw_only=True)
class Demonstration:
    """Results that the demonstration computes.

    Attributes
    ----------
    log, other : Dataset
        The log identified, and another record of the same stage.
    fit : Identification
        The model of `log`.
    score : Score
        Its deviation from `other`, to which it was not fitted.
    runs : dict of str to Tracking
        The reference tracked on a stage that is identified from `other`: without compensation,
        with the inverse of `fit`, and with PID feedback as well.
    """

    log: Dataset
    other: Dataset
    fit: Identification
    score: Score
    runs: dict[str, Tracking]


def demo_logs() -> tuple[Dataset, Dataset]:
    """Load the two measured logs of the package, with the sensor set to 0 at the lowest reading."""
    first, other = datasets.dbo_training(), datasets.dbo_tracking()
    lowest = first[slice(*WINDOW)].y.min()
    log, other = (
        Dataset(u=one.u, y=one.y - lowest, t=one.t, source=one.source) for one in (first, other)
    )
    return log, other


def run_demo(seed: int = 1, *, progress: bool | None = None) -> Demonstration:
    """Identify a model from one log, score it on the other, and track a reference.

    The stage that is controlled is not the controller's model: it is identified from the other log,
    so that the feedforward is off by about as much as on the real stage, and has the noise of the
    measured sensor.
    """
    log, other = demo_logs()
    fit = identify(log[slice(*WINDOW)], method=Descents(seed=seed), progress=progress)
    later = other[WINDOW[0] :]
    plant = VirtualStage.of(identify(later, "prandtl-ishlinskii"), noise=NOISE, seed=seed)
    reference = triangle(frequency=1.0, low=5e-6, high=42e-6, duration=4.0)
    loops = {
        "without compensation": replace(Controller.of(fit), feedforward=_straight_line(fit)),
        "inverse": Controller.of(fit),
        "inverse and PID": Controller.of(fit, feedback=FEEDBACK),
    }
    runs = {name: track(plant, loop, reference) for name, loop in loops.items()}
    return Demonstration(log=log, other=later, fit=fit, score=fit.score(later), runs=runs)


def _straight_line(fit: Identification) -> Inverse:
    """Make a feedforward of constant gain, stroke over range of the drive."""
    low, high = fit.drive_range or (0.0, 0.0)
    gain = fit.data.stroke / (high - low)
    return PrandtlIshlinskiiStage(linear=gain, thresholds=(high - low,), weights=(0.0,)).inverse()
