"""The user's first page, from a file to a tracked reference, as it would be typed."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np

import piezotrack as pt
from piezotrack.data.log_file import write_log

if TYPE_CHECKING:
    from pathlib import Path

    import pytest


def test_page_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    t = np.arange(5000) / 200.0
    drive = 37.5 * (1.0 - np.cos(2.0 * np.pi * 0.25 * t))
    write_log(pt.VirtualStage.xu_li_2010(seed=1).record(drive, 1 / 200.0), tmp_path / "stage.csv")

    log = pt.read("stage.csv")
    fit = pt.identify(log[3.0:23.0], model="dahl", method=pt.Descents(seed=1))
    assert re.search(r"Dahl, second order: stage identified from .*stage\.csv", fit.summary())
    assert len(fit.plot().axes) >= 4
    fit.save("dahl.json")
    assert pt.load("dahl.json").model == fit.model

    stage = fit.model
    assert isinstance(stage, pt.DahlStage)
    u, dt = drive, 1 / 200.0
    y = stage.simulate(u, dt).x
    assert y.shape == u.shape
    previous = stage.simulate(u[:100], dt)
    carried = stage.simulate(u[99:], dt, initial=previous.final)
    assert np.abs(carried.x - y[99:]).max() < 1e-9

    loop = pt.Controller(
        dt=0.02,
        limits=(0.0, 75.0),
        feedforward=fit.inverse(),
        feedback=pt.Pid.from_um(kp=0.120, ti=0.009, td=0.044),
        repetitive=pt.Repetitive.from_um(period=5.0, tq=0.2, kq=1.0),
    )
    run = pt.track(
        pt.VirtualStage.xu_li_2010(seed=1),
        loop,
        pt.sine(frequency=0.2, low=0.0, high=110e-6, duration=20.0),
    )
    assert run.metrics.max_error < 1.5e-6
    assert len(run.plot().axes) == 4
    session = loop.start()
    voltage = session.step(10e-6, 9.8e-6)
    assert 0.0 <= voltage <= 75.0
