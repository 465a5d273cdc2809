"""Draw the pictures of the pages that no example draws: what the code of the pages plots.

Run as ``make pictures``, or ``python docs/make_pictures.py``: band.png, profiles.png,
suggested.png, identified.png, response.png, verified.png and several_axes.png beside this file.
The others are drawn by scripts in python/examples and benches, and by ``piezotrack demo`` and
``make benchmark``.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

import piezotrack as pt

mpl.use("Agg")
DOCS = Path(__file__).parent


def band() -> None:
    """Draw a prediction with its band, on the log that was not fitted."""
    fit = pt.identify(pt.datasets.dbo_training()[3.0:23.0], "prandtl-ishlinskii")
    fit.prediction_band(pt.datasets.dbo_tracking()[30.0:40.0]).plot().savefig(DOCS / "band.png")


def profiles() -> None:
    """Draw the cost along each parameter of a Dahl stage."""
    fit = pt.identify(pt.datasets.dbo_training()[3.0:23.0], "dahl", method=pt.Descents(seed=1))
    fit.confidence(0.95).plot().savefig(DOCS / "profiles.png")


def suggested() -> None:
    """Draw the drive that determines the parameters of an identified stage best."""
    true = pt.PrandtlIshlinskiiStage(
        linear=0.8e-6,
        thresholds=(5.0, 15.0, 30.0),
        weights=(0.15e-6, 0.1e-6, 0.08e-6),
        creep_weights=(0.02, 0.02),
        creep_times=(0.2, 2.0),
        time_constant=4e-3,
    )
    slow = 37.5 - 37.5 * np.cos(2.0 * np.pi * 0.5 * np.arange(2000) * 2e-3)
    settings = pt.LeastSquares(
        thresholds=[5.0, 15.0, 30.0], creep=[0.2, 2.0], dead_zones=False, dynamics="first"
    )
    record = pt.VirtualStage.of(true, noise=5e-9, seed=1).record(slow, 2e-3)
    fit = pt.identify(record, "prandtl-ishlinskii", method=settings)
    drive = pt.suggest_drive(fit, limits=(0.0, 75.0), slew=2000.0, seconds=4.0, dt=2e-3)
    drive.plot().savefig(DOCS / "suggested.png")


def identified() -> None:
    """Draw measured and simulated displacement of the default model."""
    pt.identify(pt.datasets.dbo_training()[3.0:23.0]).plot().savefig(DOCS / "identified.png")


def responded() -> None:
    """Draw a measured response, and the sensitivity of the loop that is tuned on it."""
    plays = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(0.5, 2.0), weights=(2e-7, 1e-7))
    stage = pt.VirtualStage.of(
        plays, mode=(160.0, 0.05), delay=2e-4, noise=5e-9, limits=(0.0, 75.0)
    )
    lines = pt.RandomPhaseMultisine(band=(4.0, 900.0), low=28.0, high=32.0)
    response = pt.frequency_response(stage, lines, rate=2000.0)
    response.plot().savefig(DOCS / "response.png")
    tuned = pt.tune(response, limits=(0.0, 75.0), parts="pid")
    added = pt.RandomPhaseMultisine(band=(4.0, 900.0), low=-1.0, high=1.0, realisations=12)
    found = pt.verify(stage, tuned.controller, added, level=30e-6, model=response)
    found.plot().savefig(DOCS / "verified.png")


def several_axes() -> None:
    """Draw the responses of three axes at two levels, and the modes that were found in them."""
    axes = pt.multiaxis
    stage = axes.VirtualAxes.three(cubic=0.04, noise=2e-9, seed=1)
    records = [stage.record(realisations=9, level=level) for level in (0.5, 1.5)]
    axes.identify_axes(records).plot().savefig(DOCS / "several_axes.png")


if __name__ == "__main__":
    for draw in (band, profiles, suggested, identified, responded, several_axes):
        draw()
