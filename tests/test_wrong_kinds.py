"""An argument of another kind than it has to be is refused in a sentence, or taken as it is."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.control.learning.rules import Convergence, FrequencyRule, LiftedRule
from soak import verdict_of

if TYPE_CHECKING:
    from collections.abc import Callable

PLAYS = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(5e-7,))
LOOP = pt.Controller(
    dt=0.02, limits=(0.0, 75.0), feedforward=PLAYS.inverse(), feedback=pt.Pid(kp=1e5, ti=0.02)
)
BARE = replace(LOOP, feedforward=None)
SINE = pt.sine(frequency=1.0, low=5e-6, high=20e-6, duration=2.0)
RUN = pt.track(PLAYS, BARE, SINE)
CIRCLE = pt.contour(
    pt.XYStage(x=PLAYS, y=PLAYS), (BARE, BARE), pt.circle(frequency=0.5, radius=5e-6)
)
LOG = pt.datasets.dbo_training()[3.0:4.0]
FIT = pt.identify(LOG, "prandtl-ishlinskii")
RESPONSE = FIT.simulate(LOG)
LEARNT = pt.learn(PLAYS, SINE, BARE, trials=2)
COMPARED = pt.compare(LOG, ["prandtl-ishlinskii", "maxwell-slip"])
FALLING = Convergence(factor=0.5, model="plays", frequency=1.0, cases=())
PERIODIC = FrequencyRule(
    frequency=np.arange(5.0), learning=np.ones(5, complex), samples=8,
    forgetting_factor=1.0, cutoff=1.0, shares=(("plays", 0.5 * np.ones(5)),),
)  # fmt: skip
LIFTED = LiftedRule(keeping=np.eye(6), learning=np.eye(6), late=2, cutoff=1.0, convergence=FALLING)
ARRAY = np.array([1.0, 2.0])
# Each of a kind that other arguments take, or that compares and converts in a way of its own.
ODD = [
    *(
        1,
        0.5,
        "x",
        b"x",
        "",
        (1,),
        [1.0, 2.0],
        {"x": 1},
        ARRAY,
        np.array(1.0),
        np.array(["a", "b"]),
    ),
    *(object(), 1e308, 10**400, 1j, lambda *_: None, PLAYS, SINE, LOG),
]


CONTROL, FITS = pt.control, pt.identification
CALLS: dict[str, Callable[[Any], Any]] = {
    "check_loop": lambda v: pt.check_loop(PLAYS, v),
    "Session": CONTROL.Session,
    "InverseSession": lambda v: pt.stages.InverseSession(v, 0.02),
    "InverseSession dt": lambda v: pt.stages.InverseSession(PLAYS.inverse(), v),
    "InverseSession limits": lambda v: pt.stages.InverseSession(PLAYS.inverse(), 0.02, v),
    "Inverse.voltage samples": lambda v: PLAYS.inverse().voltage(SINE, 0.02, samples=v),
    "Inverse.played dt": lambda v: PLAYS.inverse().played(SINE, v, samples=SINE.sample(0.02)),
    "Inverse playback": lambda v: PLAYS.inverse(playback=v),
    "Controller drive_unit": lambda v: replace(BARE, drive_unit=v),
    "LeadLag method": lambda v: CONTROL.LeadLag(kp=1e5, lead=0.1, lag=0.01, method=v),
    "Objective model": lambda v: FITS.Objective(LOG, v, threads=1),
    "Objective offset": lambda v: FITS.Objective(LOG, "dahl", offset=v, threads=1),
    "Objective history": lambda v: FITS.Objective(LOG, "dahl", history=v, threads=1),
    "identify model": lambda v: pt.identify(LOG, v),
    "export_controller single": lambda v: CONTROL.export_controller(BARE, "out", single=v),
    "export_controller name": lambda v: CONTROL.export_controller(BARE, "out", name=v),
    "export_controller to": lambda v: CONTROL.export_controller(BARE, "out", to=v),
    "export_controller folder": lambda v: CONTROL.export_controller(BARE, v),
    "Controller.save": lambda v: BARE.save(v),
    "Learning.save": lambda v: LEARNT.save(v),
    "learn noise": lambda v: pt.learn(PLAYS, SINE, BARE, trials=2, noise=v),
    "Reference motion": lambda v: replace(SINE, motion=v),
    "Reference.motion": SINE.motion,
    "steps": pt.staircase(dwell=0.5, steps=2, low=0.0, high=1e-5).motion,
    "schedule waveform": lambda v: pt.schedule(
        PLAYS,
        [1e-6],
        [0.2],
        waveform=v,
        dt=0.02,
        limits=(0.0, 75.0),
        search=pt.TuningSearch(particles=2, iterations=1),
    ),
    "Dataset hold": lambda v: pt.Dataset(u=LOG.u, y=LOG.y, dt=0.01, hold=v),
    "Dataset drive_unit": lambda v: pt.Dataset(u=LOG.u, y=LOG.y, dt=0.01, drive_unit=v),
    "Drive at": lambda v: pt.hardware.Drive(name="x", duration=1.0, at=v),
    "BenchmarkRecord.of_log": pt.BenchmarkRecord.of_log,
    "Apparatus.of": pt.xu_li_2010.Apparatus.of,
    "NetworkInverse": lambda v: CONTROL.NetworkInverse(stage=PLAYS, numbers=v),
    "train_network delay": lambda v: CONTROL.train_network(LOG, units=1, plays=1, delay=v),
    "chatter": CONTROL.chatter,
    "FrequencyRule.after": lambda v: PERIODIC.after(v, v),
    "FrequencyRule.taps": PERIODIC.taps,
    "LiftedRule.after": lambda v: LIFTED.after(v, v),
    "Tracking.score": lambda v: RUN.score(true=v),
    "Tracking.part": lambda v: RUN.part(v, None, None),
    "Contour.score": lambda v: CIRCLE.score(true=v),
    "Comparison.followed": lambda v: COMPARED.followed(v, "test"),
    "Comparison.followed part": lambda v: COMPARED.followed(COMPARED.rows[0], v),
    "IdentifiedModel.fitted_on": FIT.fitted_on,
    "IdentifiedModel.window_on": FIT.window_on,
    "IdentifiedModel.start_on": FIT.start_on,
    "IdentifiedModel.score offset": lambda v: FIT.score(LOG, offset=v),
    "Tracking.plot_effort": lambda v: RUN.plot_effort(ax=v),
    "Contour.plot_magnified": lambda v: CIRCLE.plot_magnified(factor=v),
    "IdentifiedModel.plot_loop": FIT.plot_loop,
    "IdentifiedModel.plot_loop ax": lambda v: FIT.plot_loop(LOG, ax=v),
    "IdentifiedModel.plot_time": FIT.plot_time,
    "LoopReport.plot fig": lambda v: pt.check_loop(PLAYS, BARE).plot(fig=v),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_another_kind_is_refused_in_a_sentence(
    call: Callable[[Any], Any], tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    import matplotlib.pyplot as plt

    monkeypatch.chdir(tmp_path)
    faults = {repr(value)[:40]: verdict_of(partial(call, value))[0] for value in ODD}
    plt.close("all")
    assert {value: found for value, found in faults.items() if found} == {}


@pytest.mark.parametrize("motion", ["sine", 1.0, None, ARRAY])
def test_a_reference_of_no_function_is_refused_when_it_is_made(motion: Any) -> None:
    with pytest.raises(pt.ParameterError, match="motion"):
        replace(SINE, motion=motion)


def test_a_refusal_quotes_the_value_and_cuts_it() -> None:
    with pytest.raises(pt.ParameterError, match=r"controller is 'xxx.*expected pt.Controller"):
        pt.check_loop(PLAYS, "x" * 100_000)  # type: ignore[arg-type]
