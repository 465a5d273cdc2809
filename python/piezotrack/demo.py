"""The demonstration: a log from a built-in stage, identified on its first part."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import _core
from .dataset import Dataset
from .files import write_columns
from .identification import Identification, identify
from .models import DahlStage

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from .estimates import Progress

__all__ = ["SEARCH_BOX", "demo_log", "identify_demo", "write_log"]

# The box of Xu and Li 2010, section 3.3, SI.
SEARCH_BOX = {
    "mass": (0.1, 0.2),
    "damping": (1000.0, 5000.0),
    "stiffness": (1e4, 5e4),
    "piezo_coefficient": (0.01, 0.1),
}
FITTED_SECONDS = 4.0


def demo_log(seed: int = 1) -> Dataset:
    """Make the log of Fig. 7 of Xu and Li 2010: 12 s of 0.25 Hz, 0 to 75 V, at 5 kHz.

    The stage is that of Table 1, the sensor has the published noise, 0.097 um rms, and steps of
    0.038 um.

    Parameters
    ----------
    seed : int, optional
        Of the noise.

    Returns
    -------
    Dataset
        60 001 samples.
    """
    seed = _core.as_count("seed", seed)
    rate, seconds = 5000.0, 12.0
    t = np.arange(int(rate * seconds) + 1) / rate
    u = 37.5 * (1.0 - np.cos(2.0 * np.pi * 0.25 * t))
    x = DahlStage.xu_li_2010().simulate(u, 1.0 / rate).x
    noisy = x + np.random.default_rng(seed).normal(0.0, 0.097e-6, t.size)
    step = 2.5e-3 / 2**16
    return Dataset(u=u, y=step * np.round(noisy / step), dt=1.0 / rate, source="built-in stage")


def identify_demo(
    log: Dataset,
    *,
    seed: int = 1,
    progress: bool | None = None,
    callback: Callable[[Progress], object] | None = None,
) -> Identification:
    """Identify as the paper does: four parameters on the first 4 s, between its bounds.

    Parameters
    ----------
    log : Dataset
        As `demo_log` makes it.
    seed : int, optional
        Of the search.
    progress : bool, optional
        As in `identify`.
    callback : callable, optional
        As in `identify`.

    Returns
    -------
    Identification
        The hysteresis parameters, which fix the scale, are held at their published values.
    """
    published = DahlStage.xu_li_2010()
    return identify(
        log[:FITTED_SECONDS],
        fixed={"a1": published.a1, "a2": published.a2, "b1": published.b1},
        bounds=SEARCH_BOX,
        offset=False,
        seed=seed,
        progress=progress,
        callback=callback,
    )


def write_log(log: Dataset, path: Path) -> Path:
    """Write a log as a CSV file that `read` takes.

    Parameters
    ----------
    log : Dataset
        The record; its warm-up is left out.
    path : pathlib.Path
        The file.

    Returns
    -------
    pathlib.Path
        The file.
    """
    return write_columns(
        path, {"time_s": log.t, "voltage_V": log.u, "displacement_um": 1e6 * log.y}
    )
