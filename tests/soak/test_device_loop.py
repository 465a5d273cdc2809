"""A loop closed on the virtual device for a long time: `make soak LOOP=3600` for an hour each."""

from __future__ import annotations

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.control.on_device import guard, latency
from piezotrack.hardware import VirtualDevice

pytestmark = pytest.mark.slow

PLAYS = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0, 15.0), weights=(4e-7, 3e-7))


@pytest.mark.parametrize("rate", [50.0, 1000.0])
def test_the_loop_goes_on_by_the_absolute_time(
    rate: float, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The machine of a test is busy, and a virtual one stands still for half a second at times: how
    # late it is has no part in what is tested.
    monkeypatch.setattr(latency, "MOST", 1e3)
    monkeypatch.setattr(guard, "HUNG", 60.0)
    monkeypatch.setattr(guard, "MOST_LATE", 1.0)
    length = float(request.config.getoption("--soak-loop"))
    stage = pt.VirtualStage.of(PLAYS, noise=5e-9, limits=(0.0, 75.0))
    device = VirtualDevice(stage)
    feedback = pt.Pid.from_um(kp=0.1, ti=0.05)
    loop = pt.Controller(dt=1.0 / rate, limits=(0.0, 75.0), feedback=feedback)
    reference = pt.sine(frequency=0.1, low=20e-6, high=60e-6, duration=length)
    run = pt.track(device, loop, reference)
    assert isinstance(run, pt.control.DeviceTracking)
    print(run.summary())
    assert run.t.size == round(length * rate)
    assert device.held == 0.0
    # Ticks that were done were done in their time, at the end as at the beginning.
    done = np.isfinite(run.lateness)
    assert np.median(run.lateness[done][-100:]) < 0.5 * loop.dt
    late = run.t > 4.0
    assert np.std(run.error[late]) < 0.5 * np.std(run.desired[late])
