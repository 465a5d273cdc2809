"""The Bouc-Wen benchmark of Noel and Schoukens 2016, made again from its equations.

J. P. Noel and M. Schoukens, "Hysteretic benchmark with a dynamic nonlinearity", 2016, doi
10.4121/12967592. The system is `BoucWenOscillator.benchmark`, simulated at 15 kHz and sampled at
750 Hz. Tests: one settled period of a multisine of 5 to 150 Hz and 50 N rms, 8192 samples, and a
sine sweep of 40 N at 10 Hz/min from rest, 153000 samples. At this rate these go from 18 to 52 Hz,
which includes the 20 to 50 Hz that the benchmark names. The phases of its multisine are random, so
the figures are comparable and not the same. Estimation data are left to whoever takes part: here a
period of a multisine of the same kind with noise of 7 um, 1 % of its rms.

At 750 Hz a straight line from sample to sample falls short of the drive by 0.7 % at the resonance:
all parts are interpolated to four times the rate, as a user would. With the true parameters that
leaves 0.5 um; at twice the rate it leaves 1.8 um.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...data.dataset import Dataset
from ...stages.feedback.bouc_wen_oscillator import BoucWenOscillator
from ..record import BenchmarkRecord

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["RECORDS", "multisine"]

FINE, COARSE, PERIOD, SWEEP = 15000, 750, 8192, 153000
NOISE = 7e-6
# Samples for each one of the record.
FINER = 4


def multisine(seed: int) -> Array:
    """Make one period of the multisine.

    Parameters
    ----------
    seed : int
        Of the random phases.

    Returns
    -------
    ndarray, shape (163840,)
        Drive at 15 kHz [N].
    """
    n = PERIOD * FINE // COARSE
    lines = np.fft.rfftfreq(n, 1.0 / FINE)
    full = (lines >= 5.0) & (lines <= 150.0)
    spectrum = np.zeros(lines.size, dtype=complex)
    spectrum[full] = np.exp(2j * np.pi * np.random.default_rng(seed).random(int(full.sum())))
    u = np.fft.irfft(spectrum, n)
    return np.asarray(50.0 * u / np.sqrt(np.mean(u**2)), dtype=np.float64)


def _sweep() -> Array:
    t = np.arange(SWEEP * FINE // COARSE) / FINE
    return np.asarray(40.0 * np.sin(2.0 * np.pi * (18.0 * t + t * t / 12.0)), dtype=np.float64)


def _record(u: Array, noise: float = 0.0) -> Dataset:
    """Simulate at 15 kHz, and sample at 750 Hz."""
    every = FINE // COARSE
    x = BoucWenOscillator.benchmark().simulate(u, 1.0 / FINE).x[::every]
    if noise:
        x = x + noise * np.random.default_rng(1).standard_normal(x.size)
    return Dataset(u=u[::every], y=x, dt=1.0 / COARSE, drive_unit="N")


def _settled(seed: int, noise: float = 0.0) -> Dataset:
    """Two periods of a multisine, the first of them as warm-up."""
    log = _record(np.tile(multisine(seed), 2), noise)
    return log[PERIOD / COARSE :].interpolate(FINER)


def _benchmark() -> BenchmarkRecord:
    true = BoucWenOscillator.benchmark()
    # The data determine only the products of beta with gamma and delta, and beta is held at 1.
    products = {"gamma": true.beta * true.gamma, "delta": true.beta * true.delta}
    named = ("mass", "damping", "stiffness", "alpha")
    return BenchmarkRecord(
        name="bouc-wen-benchmark",
        title="Bouc-Wen benchmark",
        fitted=_settled(0, NOISE),
        others={"multisine": _settled(7), "sine sweep": _record(_sweep()).interpolate(FINER)},
        noise=NOISE,
        own_offsets=False,
        truth={name: getattr(true, name) for name in named} | products,
    )


RECORDS = {"bouc-wen-benchmark": _benchmark}
