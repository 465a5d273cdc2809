"""Ends of a loop on a device: a sensor that stands still, readings that are none, late ticks."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.control.on_device.guard import Guard

if TYPE_CHECKING:
    from collections.abc import Callable

DT, SPAN = 1e-3, 75.0


def guard(dt: float = DT) -> Guard:
    loop = pt.Controller(dt=dt, limits=(0.0, SPAN), feedback=pt.Pid.from_um(kp=0.1, ti=0.1))
    return Guard(loop.start(), dt, SPAN)


def read(there: Guard, y: float, volts: float, k: int) -> None:
    there.session.step(20e-6, y)
    there.reading(y, volts, k * there.dt)


def end_of(act: Callable[[int], None]) -> tuple[int, str]:
    """Return the sample at which a loop is ended, and the sentence."""
    for k in range(10_000):
        try:
            act(k)
        except pt.DeviceError as error:
            return k, str(error)
    pytest.fail("never ended")


def test_a_reading_that_stands_still_while_the_voltage_moves_ends_the_loop() -> None:
    there = guard()
    ended, sentence = end_of(lambda k: read(there, 20e-6, 0.01 * SPAN * k, k))
    # Twenty readings as the first, within which the voltage moved by a fifth of its range.
    assert ended == 20
    assert "stands still at 20 um" in sentence


@pytest.mark.parametrize("moves", [0.04, 0.0])
def test_a_stage_at_rest_reads_the_same_for_ever(moves: float) -> None:
    there = guard()
    for k in range(2000):
        read(there, 20e-6, SPAN * (0.5 + 0.5 * moves * math.sin(k)), k)


def test_a_sensor_with_noise_is_never_stale() -> None:
    there = guard()
    for k, noise in enumerate(np.random.default_rng(1).normal(0.0, 1e-9, 2000)):
        read(there, 20e-6 + float(noise), SPAN * (k % 2), k)


def test_readings_in_a_row_that_are_none_end_the_loop_and_are_counted() -> None:
    there = guard()
    ended, sentence = end_of(lambda k: read(there, math.nan if k else 20e-6, 1.0, k))
    assert f"{ended} readings in a row" in sentence
    assert f"{ended} not finite" in sentence
    # In time: the output is held meanwhile.
    assert ended * DT <= 1.0


def test_a_reading_in_between_begins_the_count_anew() -> None:
    there = guard()
    for k in range(5000):
        read(there, 20e-6 if k % 4 == 0 else math.nan, 1.0, k)


def test_a_device_that_hangs_ends_the_loop_at_once() -> None:
    with pytest.raises(pt.DeviceError, match="hangs"):
        guard().tick(0.3, 1.0)


def test_ticks_that_are_late_end_the_loop_where_they_are_most() -> None:
    some, most = guard(), guard()
    for k in range(4000):
        some.tick(2.0 * DT if k % 4 == 0 else 0.0, k * DT)
    ended, sentence = end_of(lambda k: most.tick(2.0 * DT, k * DT))
    assert "most ticks" in sentence
    assert ended * DT < 1.0
