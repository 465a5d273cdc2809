"""Records whose displacement does not follow the drive as that of a stage does."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.data.checks.connections import unusual_connection
from piezotrack.data.checks.record_flags import record_warnings

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

LOG = pt.datasets.dbo_training()[3.0:23.0]
RANDOM = np.random.default_rng(11)
T = np.arange(6000) / 1000.0


def resonant(u: Array, frequency: float, damping: float) -> Array:
    """Displacement of an oscillator, frequency in cycles a sample."""
    from scipy.signal import lfilter

    radius, angle = np.exp(-2.0 * np.pi * frequency * damping), 2.0 * np.pi * frequency
    y: Array = lfilter([0.0, 1.0], [1.0, -2.0 * radius * np.cos(angle), radius**2], u)
    return y


def test_the_measured_log_has_nothing_unusual() -> None:
    assert unusual_connection(LOG.u, LOG.y) is None


def test_swapped_columns_are_told_by_the_way_round_the_loop() -> None:
    """A passive stage takes up work over a cycle, whichever column is called the drive."""
    swapped = unusual_connection(1e6 * LOG.y, 1e-6 * LOG.u)
    assert swapped is not None
    assert not swapped.follows
    assert "swapped" in swapped.note
    # Nothing else is said then: units and shape of the loop are those of the other column.
    data = pt.Dataset(u=1e6 * LOG.y, y=1e-6 * LOG.u, dt=LOG.dt)
    assert record_warnings(data) == [swapped.note]
    fit = pt.identify(data, "prandtl-ishlinskii", progress=False)
    assert not any("loop" in note for note in fit.notes)


def test_a_sensor_of_the_other_sign_is_named_and_its_record_is_used() -> None:
    turned = unusual_connection(LOG.u, -LOG.y)
    assert turned is not None
    assert turned.follows
    assert "falls" in turned.note


@pytest.mark.parametrize("noise", [1e-9, 1e-6])
def test_a_sensor_that_is_not_connected_is_named(noise: float) -> None:
    found = unusual_connection(LOG.u, RANDOM.normal(0.0, noise, len(LOG)))
    assert found is not None
    assert "is the sensor connected?" in found.note


def test_a_motion_by_another_input_is_named() -> None:
    tones = [np.sin(2.0 * np.pi * f * T + f * f) for f in np.arange(1.0, 60.0, 1.3)]
    drive, other = np.sum(tones[::2], axis=0), np.sum(tones[1::2], axis=0)
    found = unusual_connection(drive, 1e-6 * resonant(other, 0.1, 0.05))
    assert found is not None
    assert "another input" in found.note
    assert unusual_connection(drive, 1e-6 * resonant(drive, 0.1, 0.05)) is None


@pytest.mark.parametrize("frequency", [0.01, 0.02, 0.1, 0.3])
@pytest.mark.parametrize("damping", [0.003, 0.02, 0.3])
def test_what_rings_under_its_drive_follows_it(frequency: float, damping: float) -> None:
    for drive in (RANDOM.normal(size=T.size), np.sin(2.0 * np.pi * (0.5 * T + 10.0 * T * T))):
        y = resonant(drive, frequency, damping)
        noise = 1e-3 * float(np.std(y)) * RANDOM.normal(size=T.size)
        found = unusual_connection(drive, y + noise)
        assert found is None or found.follows


def test_info_says_what_is_unusual_before_anything_is_fitted(tmp_path: Path) -> None:
    y = 1e-6 * LOG.u
    y[700] += 50e-6
    path = pt.Dataset(u=1e6 * LOG.y, y=y, dt=LOG.dt).save(tmp_path / "log.csv")
    notes = pt.data.info(path).notes
    assert any("3.5 s" in note for note in notes)
    assert any("swapped" in note for note in notes)
