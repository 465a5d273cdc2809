"""The stage of the paper taken through its procedure: identified on 4 s, then tracked."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import piezotrack as pt
from records import BOX, HELD, slow_sine

DT = 0.02
STAGE = pt.VirtualStage.xu_li_2010(seed=1)
PID = pt.Pid.xu_li_2010()
WINDING = replace(PID, tt=float("inf"))


@cache
def record() -> pt.Dataset:
    """0.25 Hz, 0 to 75 V, 12 s at 5 kHz, as in section 3.3 of the paper."""
    return STAGE.record(slow_sine(np.arange(60000) / 5000.0), 1 / 5000.0)


@cache
def fitted() -> pt.identification.Identification:
    """The first 4 s, with a1, a2 and b1 held at Table 1's."""
    return pt.identify(
        record()[:4.0], "dahl", parameters={**BOX, **HELD}, method=pt.Descents(seed=1)
    )


def forward() -> pt.Inverse:
    return fitted().inverse()


def loop(**parts: Any) -> pt.Controller:
    return pt.Controller(**{"dt": DT, "limits": (0.0, 75.0), **parts})


def sine(frequency: float, duration: float, low: float = 0.0, high: float = 110e-6) -> pt.Reference:
    return pt.sine(frequency=frequency, low=low, high=high, duration=duration)


@cache
def model_text() -> str:
    """The fitted model as a file has it."""
    path = Path(fitted().save("made.json"))
    text = path.read_text(encoding="utf-8")
    path.unlink()
    return text


@cache
def fig_12(what: str) -> pt.control.Tracking:
    """Run of Fig. 12, 0.2 Hz over 0 to 110 um, with feedforward (FF), feedback (FB) or both."""
    parts: dict[str, Any] = {}
    if "FF" in what:
        parts["feedforward"] = forward()
    if "FB" in what:
        parts["feedback"] = PID
    return pt.track(STAGE, loop(**parts), sine(0.2, 20.0))


@cache
def fig_13(pid: pt.Pid | None) -> pt.control.Tracking:
    """Run of Fig. 13 within 6 and 28 V: from 8 to 40 um the loop asks for 5.7 to 30.4 V.

    `None`: with the usual limits.
    """
    limits = (0.0, 75.0) if pid is None else (6.0, 28.0)
    controller = loop(limits=limits, feedforward=forward(), feedback=pid or PID)
    course = sine(0.2, 20.0, 8e-6, 40e-6)
    return pt.track(STAGE, controller, course, beyond_reach=True)
