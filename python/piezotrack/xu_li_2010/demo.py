"""The paper's demonstration: a log of its virtual stage, a model, and a tracked reference."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..control.controller.controller import Controller
from ..control.laws.pid import Pid
from ..control.parts.repetitive import Repetitive
from ..control.running.track import track
from ..identification.fit import identify
from ..identification.methods.descents import Descents
from ..references.waveforms import sine
from ..stages.feedback.dahl import DahlStage
from ..stages.virtual import VirtualStage
from .experiments.procedure import FITTED_SECONDS, SEARCH_BOX

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..control.loop.tracking import Tracking
    from ..data.dataset import Dataset
    from ..identification.fitted.estimates import Progress
    from ..identification.fitted.identification import Identification

__all__ = ["demo_log", "identify_demo", "track_demo"]


def demo_log(seed: int = 1) -> Dataset:
    """Record the log of Fig. 7 of Xu and Li 2010: 12 s of 0.25 Hz, 0 to 75 V, at 5 kHz.

    Parameters
    ----------
    seed : int, optional
        Seed of the sensor noise of the virtual stage.

    Returns
    -------
    Dataset
        60 001 samples.
    """
    rate, seconds = 5000.0, 12.0
    t = np.arange(int(rate * seconds) + 1) / rate
    u = 37.5 * (1.0 - np.cos(2.0 * np.pi * 0.25 * t))
    return VirtualStage.xu_li_2010(seed=seed).record(u, 1.0 / rate)


def identify_demo(
    log: Dataset,
    *,
    seed: int = 1,
    progress: bool | None = None,
    callback: Callable[[Progress], object] | None = None,
) -> Identification:
    """Identify as in the paper: four parameters from the first 4 s, between its bounds.

    Parameters
    ----------
    log : Dataset
        As of `demo_log`.
    seed : int, optional
        Seed of the search.
    progress : bool, optional
        As in `identify`.
    callback : callable, optional
        As in `identify`.

    Returns
    -------
    Identification
        The hysteresis parameters, which set the scale, are held at their published values.
    """
    published = DahlStage.xu_li_2010()
    return identify(
        log[:FITTED_SECONDS],
        "dahl",
        parameters={
            **SEARCH_BOX,
            "a1": published.a1,
            "a2": published.a2,
            "b1": published.b1,
        },
        method=Descents(seed=seed),
        progress=progress,
        callback=callback,
    )


def track_demo(fit: Identification, seed: int = 1) -> dict[str, Tracking]:
    """Track 0.2 Hz over 110 um with each part of the controller, as in Fig. 12 of the paper.

    Parameters
    ----------
    fit : Identification
        The model; its inverse is the feedforward.
    seed : int, optional
        Seed of the sensor noise of the virtual stage.

    Returns
    -------
    dict of str to Tracking
        With feedforward alone, with PID alone, and with both and a repetitive part.
    """
    stage = VirtualStage.xu_li_2010(seed=seed)
    reference = sine(frequency=0.2, low=0.0, high=110e-6, duration=20.0)
    inverse, pid = fit.inverse(), Pid.xu_li_2010()
    learning = Repetitive.from_um(period=5.0, tq=0.2, kq=1.0)
    loops = {
        "feedforward": Controller(dt=0.02, limits=(0.0, 75.0), feedforward=inverse),
        "pid": Controller(dt=0.02, limits=(0.0, 75.0), feedback=pid),
        "all": Controller(
            dt=0.02, limits=(0.0, 75.0), feedforward=inverse, feedback=pid, repetitive=learning
        ),
    }
    return {name: track(stage, loop, reference) for name, loop in loops.items()}
