"""What is printed of objects: a short line each, lengths in um, and tables in a notebook."""

from __future__ import annotations

import dataclasses
import pickle
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import piezotrack as pt
from all_stages import STAGES

LOOP = pt.Controller(
    dt=0.02,
    limits=(0.0, 75.0),
    feedforward=pt.DahlStage.xu_li_2010().inverse(),
    feedback=pt.Pid.xu_li_2010(),
)


@cache
def log() -> pt.Dataset:
    u = 37.5 - 37.5 * np.cos(np.arange(600) / 50.0)
    return pt.Dataset(u=u, y=1.6e-6 * u, dt=0.005, source="<log>.csv")


@cache
def fit() -> pt.identification.Identification:
    return pt.identify(log(), "prandtl-ishlinskii", progress=False)


@pytest.mark.parametrize("name", STAGES)
def test_a_stage_is_a_short_line(name: str) -> None:
    stage = STAGES[name]
    shown = repr(stage)
    assert len(shown) < 110, shown
    assert shown.startswith(f"{type(stage).__name__}(")
    assert "e-0" not in shown
    assert "\n" not in shown
    # The parameters are as before: fields, and equal after a copy.
    assert {one.name for one in dataclasses.fields(stage)} == set(stage.parameter_names())  # type: ignore[arg-type]
    assert pickle.loads(pickle.dumps(stage)) == stage


def test_the_gain_that_is_shown_is_that_of_a_settled_loop() -> None:
    stage = pt.PrandtlIshlinskiiStage(
        linear=1e-6, thresholds=(0.5, 1.0, 1.5), weights=(0.1e-6, 0.2e-6, 0.3e-6)
    )
    u = np.tile(np.concatenate([np.linspace(0, 3, 100), np.linspace(3, 0, 100)]), 3)
    x = stage.simulate(u, 0.01).x[400:]
    assert f"({1e6 * np.ptp(x) / 3.0:.3g} um/V, 3 plays)" in repr(stage)


def test_a_stage_tells_its_dynamics() -> None:
    assert repr(pt.DahlStage.xu_li_2010()) == (
        "DahlStage(1.8 um/V, natural frequency 60.1 Hz, lag 99.6 ms)"
    )
    stage = pt.PrandtlIshlinskiiStage(
        linear=1e-6,
        thresholds=(1.0,),
        weights=(1e-6,),
        creep_weights=(0.01,),
        creep_times=(1.0,),
        time_constant=1.2e-3,
    )
    assert repr(stage) == "PrandtlIshlinskiiStage(1 um/V, 1 play, lag 1.2 ms, 1 creep time)"


def test_a_controller_and_what_runs_on_it_are_short_lines() -> None:
    assert repr(LOOP) == "Controller(feedforward (Dahl, second order) + PID, 50 Hz, 0 to 75 V)"
    assert pickle.loads(pickle.dumps(LOOP)) == LOOP
    session = LOOP.start()
    assert repr(session) == "<Session, 50 Hz, 0 to 75 V: last 0 V, error 0 um>"
    voltage = session.step(1e-6, 0.0)
    assert repr(session) == f"<Session, 50 Hz, 0 to 75 V: last {voltage:.4g} V, error 1 um>"
    report = pt.check_loop(pt.VirtualStage.xu_li_2010(), LOOP)
    assert repr(report).startswith("<LoopReport at 1.5")
    assert "stable, gain margin" in repr(report)
    assert len(repr(report)) < 110


def test_a_loop_that_is_not_stable_at_every_gain_says_so() -> None:
    fast = dataclasses.replace(LOOP, feedback=pt.Pid.from_um(kp=0.15, ti=0.009, td=0.044))
    report = pt.check_loop(pt.VirtualStage.xu_li_2010(), fast)
    assert report.stable
    assert not report.everywhere
    assert repr(report).endswith("; not at every gain of the stage>")


def test_a_model_and_a_fit_are_short_lines() -> None:
    assert repr(fit()).startswith("<Identification, Prandtl-Ishlinskii: ")
    model = pt.identification.IdentifiedModel(
        model=pt.DahlStage.xu_li_2010(), offset=1e-4, offset_fitted=True, stroke=45e-6
    )
    assert repr(model) == f"<IdentifiedModel, stroke 45 um: {model.model!r}>"


def test_a_notebook_shows_tables_without_markup_of_the_record() -> None:
    for shown in (fit(), log(), pt.compare(log(), ["prandtl-ishlinskii"])):
        table = shown._repr_html_()
        assert table.startswith("<table>")
        assert table.endswith("</table>")
        assert "<log>" not in table
        assert f"{fit().cost_percent:.3g} % of stroke" in fit()._repr_html_()
    assert "120 um" in log()._repr_html_()
    assert "&lt;log&gt;.csv" in log()._repr_html_()


def test_a_table_of_a_search_has_every_parameter() -> None:
    few = pt.ParticleSwarm(iterations=5)
    fit = pt.identify(log(), "dahl", method=replace(few, seed=1, runs=1), progress=False)
    table = fit._repr_html_()
    for name in fit.parameters:
        assert f"<th>{name}</th>" in table
    assert table.count("<tr>") > len(fit.parameters)


def test_only_public_names_are_listed() -> None:
    for room in (pt, pt.stages, pt.control, pt.identification, pt.references, pt.data):
        listed = [name for name in dir(room) if not name.startswith("__")]
        assert listed == sorted(name for name in room.__all__ if not name.startswith("__"))
