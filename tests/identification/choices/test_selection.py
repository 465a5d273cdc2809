"""`model="auto"`: the kind that is best on what was not fitted."""

import dataclasses
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack._support.statistics import sample_noise
from piezotrack.benchmarking.records.made_up import RECORDS
from piezotrack.identification.fitted.selection import Trial
from piezotrack.identification.problem.problem import Problem
from piezotrack.identification.problem.records import records_of
from piezotrack.identification.solve.one_model import identify_model
from piezotrack.identification.solve.selecting import trials
from piezotrack.identification.solve.selecting.shown import as_shown
from piezotrack.identification.solve.weights import Structure
from records import of_relays, selection_of

DT = 1e-3
T = DT * np.arange(4000)
# The amplitude ramps to a quarter: small loops tell the kinds apart.
U = 37.5 + (37.5 - 7.0 * T) * np.sin(2.0 * np.pi * T - np.pi / 2.0)
PLAYS = pt.PrandtlIshlinskiiStage(
    linear=8e-7, thresholds=(3.0, 8.0, 15.0, 25.0), weights=(1e-7, 1e-7, 1e-7, 1e-7)
)
SMOOTH = pt.FirstOrderDahlStage(
    mass=0.02,
    damping=200.0,
    stiffness=1e6,
    piezo_coefficient=1.8,
    rest_stiffness=2.5e5,
    coulomb_force=4.0,
)


BRANCHES = pt.BoucWenStage(
    mass=0.36,
    damping=160.0,
    stiffness=1e6,
    piezo_coefficient=4.8e-7,
    alpha=0.3,
    beta=120.0,
    gamma=-10.0,
    exponent=1.6,
)


def of_branches(count: int) -> tuple[pt.Dataset, pt.Dataset]:
    """A triangle whose amplitude falls, with noise of 0.1 % of the stroke; another motion."""
    t = np.linspace(0.0, 10.0, count)
    tops = np.linspace(1.0, 0.1, 14) * np.tile([60.0, -60.0], 7)
    falling = np.interp(t, np.linspace(0.0, 10.0, 15), [0.0, *tops])
    other = 30.0 * np.sin(8.2 * t) * (1.0 + 0.5 * np.sin(1.9 * t))
    x, y = (BRANCHES.simulate(u, t[1]).x for u in (falling, other))
    x += 1e-3 * np.ptp(x) * np.random.default_rng(1).normal(size=count)
    return pt.Dataset(u=falling, y=x, t=t), pt.Dataset(u=other, y=y, t=t)


def record(stage: pt.stages.Stage, noise: float) -> pt.Dataset:
    x = stage.simulate(U, DT, initial=stage.equilibrium(U[0])).x
    return pt.Dataset(u=U, y=x + noise * np.random.default_rng(0).normal(size=x.size), dt=DT)


def tried(fit: pt.identification.Identification) -> list[str]:
    return [trial.model for trial in selection_of(fit).trials]


def test_plays_that_leave_noise_end_the_trials_of_other_weights() -> None:
    fit = pt.identify(record(PLAYS, 1e-8), progress=False)
    assert fit.model.info.name == "prandtl-ishlinskii"
    assert fit.cost < 3e-8
    # Few values might explain as much.
    assert set(tried(fit)) <= {"prandtl-ishlinskii", "bouc-wen"}
    assert selection_of(fit).fitted_until is not None
    until = selection_of(fit).fitted_until
    assert f"{until:.4g} s, by their rms after it:" in fit.summary()


def test_trials_in_threads_are_those_one_after_the_other() -> None:
    data = record(SMOOTH, 2e-9)
    method = pt.Descents(seed=1, runs=2)
    one, two = (pt.identify(data, method=method, threads=count) for count in (1, 2))
    assert [(trial.model, trial.rms) for trial in selection_of(one).trials] == [
        (trial.model, trial.rms) for trial in selection_of(two).trials
    ]
    assert one.cost == two.cost


def test_ctrl_c_ends_trials_in_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[str] = []

    def until_stopped(problem: Any, method: Any, run: Any, *rest: Any) -> Any:
        if run.stopped is None:
            return identify_model(problem, method, run, *rest)
        while not run.stopped():
            time.sleep(0.01)
        ended.append(problem.model)
        raise pt.Interrupted("interrupted")

    def interrupt(_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(trials, "identify_model", until_stopped)
    monkeypatch.setattr(trials, "waited_for", interrupt)
    with pytest.raises(pt.Interrupted, match="before the weights were found"):
        pt.identify(record(SMOOTH, 2e-9))
    waited = time.monotonic()
    while len(ended) < 2 and time.monotonic() < waited + 10.0:
        time.sleep(0.01)
    # Two had begun, the others do not begin any more.
    assert len(ended) == 2


def test_smooth_tips_are_told_from_plays(tmp_path: Path) -> None:
    fit = pt.identify(record(SMOOTH, 1e-9), method=pt.Descents(seed=1, runs=2), progress=False)
    assert fit.model.info.name in ("first-order-dahl", "parallel-dahl")
    found = selection_of(fit).trials
    assert found[0].model == fit.model.info.name
    assert found[0].rms < 0.5 * next(
        trial.rms for trial in found if trial.model == "prandtl-ishlinskii"
    )
    document = json.loads(fit.save(tmp_path / "model.json").read_text(encoding="utf-8"))
    assert document["selection"]["models"].keys() == set(tried(fit))
    assert pt.load(tmp_path / "model.json").model == fit.model


def test_branches_that_plays_describe_only_in_the_record_are_searched() -> None:
    """Plays leave 1.4 times the noise, and 0.3 % of the stroke of another motion."""
    log, other = of_branches(2500)
    fit = pt.identify(log, progress=False)
    assert fit.model.info.name == "bouc-wen"
    assert fit.cost_percent < 0.101
    assert fit.model.exponent == pytest.approx(1.6, rel=0.05)
    assert fit.score(other).rms < 2e-4 * log.stroke


def test_an_exponent_is_found_in_a_long_record_of_a_triangle() -> None:
    """Its turns lie between the samples that are kept of it."""
    log, other = of_branches(7000)
    fit = pt.identify(log, "bouc-wen", progress=False)
    assert fit.model.exponent == pytest.approx(1.6, rel=0.03)
    assert fit.score(other).rms < 2e-4 * log.stroke


def test_a_record_of_one_loop_is_judged_on_its_last_quarter() -> None:
    short = record(PLAYS, 1e-8)[:1.5]
    fit = pt.identify(short, progress=False)
    assert selection_of(fit).fitted_until == pytest.approx(0.75 * 1.5, rel=0.01)
    assert fit.model.info.name == "prandtl-ishlinskii"


def test_the_swing_of_a_mode_does_not_hide_what_is_left() -> None:
    swinging = dataclasses.replace(PLAYS, frequency=150.0, damping_ratio=0.1)
    u = 37.5 - 30.0 * np.cos(2.0 * np.pi * (1.0 + 20.0 * T) * T)
    y = swinging.simulate(u, DT).x + 1e-8 * np.random.default_rng(0).normal(size=T.size)
    few = pt.identification.LeastSquares(count=1, dead_zones=False, creep=False, dynamics="second")
    fit = pt.identify(pt.Dataset(u=u, y=y, dt=DT), "prandtl-ishlinskii", method=few)
    # The motion between samples is no less than the residual, which is far above the noise.
    assert 3e-8 < fit.cost < 3.0 * sample_noise(y)
    trial = Trial("prandtl-ishlinskii", "Prandtl-Ishlinskii", fit.cost)
    chosen = dataclasses.replace(
        fit, selection=pt.identification.Selection(trials=(trial,), fitted_until=1.0)
    )
    assert any("times the noise between samples" in note for note in chosen.notes)


def test_a_search_takes_three_of_the_time_constants_that_plays_have_shown() -> None:
    times = [0.01, 0.1, 1.0, 10.0, 100.0, 1000.0]
    shown = Structure(["virgin"], [None], [False], times, [])
    log = record(PLAYS, 1e-9)
    records = records_of(log, offset=True, delay=None, drift=None, history=None)
    problem = as_shown(Problem.checked("bouc-wen", records, None, None, None), shown)
    assert problem.creep == (0.01, 1.0, 1000.0)
    # As many as a search accepts.
    assert pt.identification.Objective(log, "bouc-wen", creep=problem.creep).ranges
    with pytest.raises(pt.ParameterError, match="3 time constants at most"):
        pt.identification.Objective(log, "bouc-wen", creep=times)


def test_parameters_need_a_named_model() -> None:
    with pytest.raises(pt.ParameterError, match="name the model"):
        pt.identify(record(PLAYS, 1e-8), parameters={"mass": 0.1})


def test_a_kind_that_diverges_on_the_rest_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that cannot be simulated on what was not fitted is no reason to give up the others."""
    t = np.arange(1500) / 250.0
    u = 40.0 - 40.0 * np.cos(2 * np.pi * 0.5 * t)
    stage = pt.BoucWenStage.xu_li_2010_corrected()
    log = pt.Dataset(u=u, y=stage.simulate(u, 1 / 250.0).x, dt=1 / 250.0)
    simulated = pt.identification.IdentifiedModel.simulate
    names: list[str] = []

    def diverging(self: pt.identification.IdentifiedModel, *args: Any, **kwargs: Any) -> Any:
        names.append(self.model.info.name)
        if len(names) == 1:
            raise pt.NumericalError("the simulated motion is not finite from sample 9 on")
        return simulated(self, *args, **kwargs)

    monkeypatch.setattr(pt.identification.IdentifiedModel, "simulate", diverging)
    fit = pt.identify(log, method=pt.ParticleSwarm(particles=8, iterations=5, seed=1, runs=1))
    assert names[0] not in tried(fit)
    assert tried(fit)


def test_a_rate_that_only_the_whole_record_shows_decides() -> None:
    # 0.1, 1 and 10 Hz one after the other: the first three fifths do not show the fastest.
    of_rates = RECORDS["rate-three"]()
    fit = pt.identify(of_rates.fitted)
    assert fit.model.info.name == "rate-dependent-prandtl-ishlinskii"
    # Plays without a rate leave 3.5 times the noise there.
    noise = of_rates.noise
    assert noise is not None
    assert fit.score(of_rates.others["at 10 Hz"]).rms < 2.0 * noise


@pytest.mark.parametrize("seed", [10, 11])
def test_a_model_that_leaves_only_noise_on_the_whole_is_taken(seed: int) -> None:
    # The first three fifths do not determine relays (10); plays leave 1.3 times the noise (11).
    log, _ = of_relays(seed)
    fit = pt.identify(log)
    assert fit.cost < 1.05 * max(fit.noises)


def test_a_search_begins_with_the_rest_that_weights_have_shown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each voltage of rest that is tried takes a search: minutes where the model does not suit."""
    t = np.linspace(0.0, 6.0, 1200)
    tops = np.linspace(1.0, 0.2, 12) * np.tile([-60.0, 60.0], 6)
    u = np.interp(t, np.linspace(0.0, 6.0, 13), [40.0, *tops])
    x = BRANCHES.simulate(np.append(0.0, u), t[1]).x[1:]
    x += 1e-4 * np.ptp(x) * np.random.default_rng(1).normal(size=t.size)
    begun: dict[str, Any] = {}

    def noted(problem: Problem, method: Any, how: Any, start: Any, rest: Any) -> Any:
        if isinstance(method, pt.ParticleSwarm):
            begun.setdefault(problem.model, rest)
        return identify_model(problem, method, how, start, rest)

    monkeypatch.setattr(trials, "identify_model", noted)
    few = pt.ParticleSwarm(particles=8, iterations=5, seed=1, runs=1)
    pt.identify(pt.Dataset(u=u, y=x, dt=t[1]), method=few)
    assert {"first-order-dahl", "bouc-wen"} <= set(begun)
    assert all(rest is not None and rest.voltage == 0.0 for rest in begun.values())
