"""Noise of a sensor, from a record of a stage at rest."""

from __future__ import annotations

import math

import matplotlib.pyplot as plt
import numpy as np
import pytest

import piezotrack as pt
from piezotrack.identification.solve.judging import repeated
from virtual import changed

UM = 1e-6
ALONG_X = pt.VirtualStage.xu_li_2010(seed=1)
STAGE = pt.XYStage.xu_li_2010(seed=1)
TWIN = changed(ALONG_X, seed=77, noise=0.0, resolution=1e-9, noise_bandwidth=1.0)


def test_noise_is_found_again_and_given_to_a_stage() -> None:
    """Fig. 3: 0.097 um rms, steps of 0.038 um."""
    assert STAGE.x == ALONG_X
    record = ALONG_X.record(np.zeros(50000), 1 / 5000.0)
    noise = pt.identification.identify_noise(record)
    assert noise.rms == pytest.approx(0.097 * UM, rel=0.02)
    assert noise.resolution == pytest.approx(0.038 * UM, rel=0.01)
    assert noise.bandwidth == pytest.approx(200.0, rel=0.05)
    again = pt.identification.identify_noise(
        noise.of_stage(TWIN).record(np.zeros(50000), 1 / 5000.0)
    )
    assert again.rms == pytest.approx(noise.rms, rel=0.03)
    assert again.resolution == pytest.approx(noise.resolution, rel=1e-6)
    # Parseval: the spectra hold the variance, and the model's is Welch's.
    f, density = noise.spectrum()
    assert np.sum(density**2) * (f[1] - f[0]) == pytest.approx(noise.rms**2, rel=0.05)
    for low, high in ((20, 100), (300, 600), (1500, 2400)):
        part = (f > low) & (f < high)
        ratio = np.mean(density[part] ** 2) / np.mean(noise.density(f[part]) ** 2)
        assert ratio == pytest.approx(1.0, abs=0.15)
    figure = noise.plot()
    figure.canvas.draw()
    assert [ax.get_xlabel() for ax in figure.axes] == ["time [ms], of 10 s", "frequency [Hz]"]
    plt.close(figure)


def test_the_grid_is_found_where_few_levels_show() -> None:
    random = np.random.default_rng(2)
    for step, noise in ((0.15 * UM, 0.1 * UM), (0.01 * UM, 0.1 * UM)):
        y = step * np.round(random.normal(3 * UM, noise, 5000) / step)
        log = pt.Dataset(u=np.zeros(5000), y=y, dt=1e-3)
        sensor = pt.identification.identify_noise(log)
        assert sensor.resolution == pytest.approx(step, rel=1e-6)
        assert sensor.noise == pytest.approx(noise, rel=0.1)
        assert sensor.bandwidth_sd is None
        assert math.isinf(sensor.bandwidth)
        assert "white" in sensor.summary()


@pytest.mark.parametrize("spikes", [0, 5])
def test_what_does_not_repeat_is_the_noise_of_a_stage_that_creeps_from_rest(spikes: int) -> None:
    # 5.3 periods of 303.03 samples, from a stage that never moved before.
    random, t = np.random.default_rng(4), np.arange(1600) / 1000.0
    u = 60.0 + 40.0 * np.sin(2.0 * np.pi * 3.3 * t)
    stage = pt.PrandtlIshlinskiiStage(
        linear=1e-7,
        thresholds=(10.0, 30.0),
        weights=(5e-8, 5e-8),
        creep_weights=(0.1,),
        creep_times=(1.0,),
    )
    noise = 1e-3 * UM
    y = stage.simulate(u, 1e-3).x + noise * random.normal(size=t.size)
    y[random.integers(0, t.size, spikes)] += 3.0 * UM
    log = pt.Dataset(u=u, y=y, dt=1e-3).without_faulty_readings()
    assert repeated(log) == pytest.approx(noise, rel=0.1)


def test_a_record_that_moves_is_not_at_rest() -> None:
    t = np.arange(5000) / 1000.0
    u = 10.0 * np.sin(2 * np.pi * t)
    with pytest.raises(pt.DataError, match="the displacement follows the drive"):
        pt.identification.identify_noise(pt.Dataset(u=u, y=1e-6 * u, t=t))
