"""Controllers of every kind that has a form in C, and the C compiler."""

from __future__ import annotations

import math
import os
import platform
import shutil
import subprocess
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from pathlib import Path

GCC, GXX = shutil.which("gcc"), shutil.which("g++")
needs_gcc = pytest.mark.skipif(
    GCC is None or os.name == "nt", reason="no C compiler: gcc is not installed, or Windows"
)
needs_gxx = pytest.mark.skipif(
    GXX is None or os.name == "nt", reason="no C++ compiler: g++ is not installed, or Windows"
)
# Units have a binary for this one.
needs_linux = pytest.mark.skipif(
    GCC is None or (platform.system(), platform.machine()) != ("Linux", "x86_64"),
    reason="units are compiled by gcc on Linux, x86-64",
)
STRICT = (
    *("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-ffp-contract=off"),
    *("-Wconversion", "-Wsign-conversion", "-Wdouble-promotion", "-Wshadow"),
)

PI = pt.Pid.from_um(kp=0.05, ti=0.02)
SLIDING = pt.control.SlidingMode(switching=3.0, layer=20e-6, ti=0.05, td=0.01, tf=0.03)
DAHL = pt.DahlStage.xu_li_2010()


def learner(**given: Any) -> pt.Repetitive:
    return pt.Repetitive.from_um(**given)


PARTS: dict[str, dict[str, Any]] = {
    "nothing": {},
    "PID": {"feedback": pt.Pid.xu_li_2010()},
    "PD": {"feedback": pt.Pid(kp=1e5, ti=math.inf, td=0.001)},
    "filters and jumps": {
        "feedback": PI,
        "filters": [pt.LowPass(5.0), pt.Notch(15.0)],
        "max_jump": 2e-5,
        "span": (-2e-5, 1.5e-4),
    },
    "state space": {
        "feedback": pt.control.StateSpace([[0.9, 1 / 3], [0.0, 1.0]], [1e3, 3e3], [1.0, 2.0], 5e4)
    },
    "lead-lag": {"feedback": pt.control.LeadLag(kp=1e5, lead=0.05, lag=0.3)},
    "sliding mode": {"feedback": SLIDING},
    "sliding mode, no integral": {"feedback": pt.control.SlidingMode(switching=3.0, layer=20e-6)},
    "disturbance observer": {
        "feedback": pt.control.DisturbanceObserver(
            pid=PI, plant_gain=1.5e-6, cutoff=1.0, plant_time=0.05
        )
    },
    "perturbation": {
        "feedback": pt.control.PerturbationEstimator(sliding=SLIDING, plant_gain=1.5e-6, cutoff=1.0)
    },
    "hysteresis observer": {"feedback": pt.control.HysteresisObserver(stage=DAHL, pid=PI)},
    "integral resonant control": {
        "feedback": pt.control.IntegralResonantControl(pid=PI, gain=1e7, feedthrough=3e-6)
    },
    "positive position feedback": {
        "feedback": pt.control.PositivePositionFeedback(
            pid=PI, gain=0.2e6, frequency=7.0, damping_ratio=0.6
        ),
        "filters": [pt.LowPass(20.0)],
    },
    "positive velocity and position feedback": {
        "feedback": pt.control.PositiveVelocityPositionFeedback(
            pid=PI, velocity_gain=-0.1e6, position_gain=0.2e6, frequency=9.0, damping_ratio=0.6
        )
    },
    "Dahl with damping": {
        "feedforward": DAHL.inverse(),
        "feedback": pt.control.PositivePositionFeedback(
            pid=PI, gain=0.2e6, frequency=7.0, damping_ratio=0.6
        ),
        "filters": [pt.LowPass(20.0)],
    },
    "repetitive": {"feedback": PI, "repetitive": learner(period=5.0, kq=0.3, tq=0.05)},
    "repetitive, part of a sample": {
        "feedback": PI,
        "repetitive": learner(
            period=2.507, kq=0.6, smoothing=pt.control.ZeroPhase(order=3), lead=2
        ),
    },
    "repetitive of the paper": {"feedback": PI, "repetitive": pt.Repetitive.xu_li_2010(5.0)},
    "repetitive alone": {"repetitive": learner(period=0.2, kq=0.6, smoothing=None)},
    "Dahl": {"feedforward": DAHL.inverse(), "feedback": PI},
    "Dahl with dry friction": {"feedforward": replace(DAHL, b0=40.0).inverse()},
    "all": {
        "feedforward": pt.Inverse(stage=DAHL, offset=1e-6, delay=0.03),
        "feedback": pt.Pid.xu_li_2010(),
        "repetitive": learner(period=5.0, kq=0.3, tq=0.05),
        "filters": [pt.LowPass(20.0)],
    },
}


def loop(name: str) -> pt.Controller:
    return pt.Controller(dt=0.02, limits=(0.0, 75.0), **PARTS[name])


def compiled(
    folder: Path, *sources: str, flags: tuple[str, ...] = STRICT, libraries: tuple[str, ...] = ()
) -> None:
    """Compile the sources of a folder, without a warning."""
    assert GCC is not None
    command = [GCC, *flags, "-O2", "-o", "check", *sources, *libraries]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def checked(folder: Path) -> tuple[int, dict[str, float]]:
    """Run check: its exit code, and the figures that it prints."""
    done = subprocess.run(["./check"], cwd=folder, capture_output=True, text=True, check=False)
    figures = {}
    for part in done.stdout.strip().split(", "):
        words = part.replace(" at step", ", at step").split(",")[0].split()
        numbers = [float(word) for word in words if word[0].isdigit()]
        figures[words[0]] = numbers[0]
    return done.returncode, figures
