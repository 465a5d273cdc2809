"""Where a record begins: in equilibrium, after a history that is given or shown by the record."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.identification.solve.search import search_parameters

DT = 1e-3
NOISE = 10e-9
STAGE = pt.FirstOrderDahlStage(
    mass=1e6 / (2.0 * np.pi * 400.0) ** 2,
    damping=500.0,
    stiffness=1e6,
    piezo_coefficient=1.8,
    rest_stiffness=2.5e5,
    coulomb_force=8.0,
)
QUICK = pt.ParticleSwarm(iterations=30)


def record(visited: list[float], seed: int = 0, amplitude: float = 35.0) -> pt.Dataset:
    """A sine about 40 V, after slow visits to voltages, on a sensor with an offset."""
    t = DT * np.arange(3000)
    u = 40.0 + amplitude * np.sin(2.0 * np.pi * t)
    x = STAGE.simulate(u, DT, initial=STAGE.equilibrium([*visited, u[0]])).x
    noise = NOISE * np.random.default_rng(seed).normal(size=t.size)
    return pt.Dataset(u=u, y=x + 3e-6 + noise, dt=DT)


def fitted(log: pt.Dataset, **settings: Any) -> pt.identification.Identification:
    return pt.identify(
        log, "first-order-dahl", method=replace(QUICK, seed=1, runs=2), progress=False, **settings
    )


def test_a_record_at_a_bias_is_fitted_to_its_noise() -> None:
    log = record([])
    fit = fitted(log, history="virgin")
    # A jump from 0 V to its first sample would cost micrometres.
    assert fit.cost < 3.0 * NOISE
    assert fit.start is not None
    assert fit.start.history == "virgin"
    assert "in equilibrium at 40 V, never moved before" in fit.summary()


def test_the_voltage_that_the_stage_came_from_is_found() -> None:
    log = record([75.0])
    wrong = fitted(log, history="virgin")
    fit = fitted(log)
    assert fit.cost < 3.0 * NOISE < 10.0 * NOISE < wrong.cost
    assert fit.start is not None
    assert fit.start.history == "fit"
    assert fit.start.voltage == pytest.approx(75.0, abs=5.0)
    assert fit.parameters["voltage_before"].identified
    assert "after an earlier drive of 7" in fit.summary()
    assert any("first" in note for note in wrong.notes)


def test_plays_beyond_half_of_the_range_move_once() -> None:
    """A stage that was never moved: its widest plays move up to the first peak, and never again."""
    stage = pt.PrandtlIshlinskiiStage(
        linear=8e-7, thresholds=(3.0, 12.0, 27.0, 33.0), weights=(1e-7, 1e-7, 1e-7, 1e-7)
    )
    t = DT * np.arange(2000)
    u = 40.0 + 25.0 * np.sin(2.0 * np.pi * t)
    x = stage.simulate(u, DT, initial=stage.equilibrium([40.0])).x
    noise = NOISE * np.random.default_rng(1).normal(size=t.size)
    log = pt.Dataset(u=u, y=x + noise, dt=DT)
    fit = pt.identify(log, "prandtl-ishlinskii", history="virgin")
    assert fit.cost < 1.5 * NOISE
    # The two wide ones as one of half of the range.
    assert isinstance(fit.model, pt.PrandtlIshlinskiiStage)
    assert 24.9 < fit.model.thresholds[-1] < 27.0
    assert fit.model.weights[-1] == pytest.approx(2e-7, rel=0.05)


@pytest.mark.parametrize(
    ("visited", "searched"), [([], ["virgin"]), ([75.0], ["virgin", "settled", "fit"])]
)
def test_a_record_is_searched_again_only_for_a_history_that_it_shows(
    visited: list[float], searched: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = []

    def search(problem: Any, *arguments: Any) -> Any:
        settings.append(problem.records[0].history)
        return search_parameters(problem, *arguments)

    monkeypatch.setattr("piezotrack.identification.solve.one_model.search_parameters", search)
    pt.identify(record(visited), "first-order-dahl")
    assert set(settings) <= set(searched)
    assert settings[-1] == searched[-1]


@pytest.mark.parametrize("swarm", [pt.ParticleSwarm.xu_li_2010(), QUICK], ids=["paper", "ring"])
def test_a_swarm_runs_once_whatever_the_history(swarm: pt.ParticleSwarm) -> None:
    log, swarm = record([75.0]), replace(swarm, seed=1, runs=2)
    seen: list[pt.identification.Progress] = []
    virgin = pt.identify(log, "first-order-dahl", method=swarm, history="virgin")
    fit = pt.identify(log, "first-order-dahl", method=swarm, callback=seen.append)
    assert virgin.search is not None
    assert fit.search is not None
    assert fit.start is not None
    assert fit.start.history == "fit"
    assert fit.cost < 1.1 * NOISE
    assert (fit.method, fit.nfev, fit.message) == (swarm, virgin.nfev, virgin.message)
    assert fit.search.runs == virgin.search.runs
    assert fit.search.history.tolist() == virgin.search.history.tolist()
    # The rest are descents, which a callback sees too.
    assert fit.search.npolish - virgin.search.npolish < 3000
    assert len(seen) > fit.search.nit
    assert fit.details["fit"]["polish_simulations"] == fit.search.npolish
    assert f"{fit.cost_um:.4g} um" in fit.summary()


def test_a_swarm_keeps_a_history_that_only_a_descent_betters() -> None:
    # Far from the minimum, as it is not refined.
    coarse = pt.ParticleSwarm(particles=4, iterations=3, polish=False, runs=1)
    fits = [
        pt.identify(record([]), "first-order-dahl", method=coarse, history=history)
        for history in (None, "virgin")
    ]
    assert fits[0].cost == fits[1].cost > 5.0 * NOISE
    assert fits[0].nfev == fits[1].nfev


@pytest.mark.slow
def test_a_long_record_is_asked_at_its_beginning(monkeypatch: pytest.MonkeyPatch) -> None:
    log = record([75.0])
    expected = pt.identify(log, "first-order-dahl").cost
    monkeypatch.setattr("piezotrack.identification.solve.earlier_motion.BEGINNING", 1500)
    assert pt.identify(log, "first-order-dahl").cost == expected
    # Without a reversal in its beginning, all of it.
    monkeypatch.setattr("piezotrack.identification.solve.earlier_motion.BEGINNING", 20)
    assert pt.identify(log, "first-order-dahl").cost == expected


def test_a_settled_stage_repeats() -> None:
    u = 40.0 + 35.0 * np.sin(2.0 * np.pi * DT * np.arange(6000))
    x = STAGE.simulate(u, DT, initial=STAGE.equilibrium(40.0)).x
    log = pt.Dataset(u=u[3000:], y=x[3000:], dt=DT)
    fit = fitted(log, history="settled")
    assert fit.cost < 1e-3 * log.stroke


def test_the_history_is_kept_with_the_model(tmp_path: Path) -> None:
    log = record([75.0])
    fit = fitted(log, history="fit")
    loaded = pt.load(fit.save(tmp_path / "model.json"))
    assert loaded.start == fit.start
    assert loaded.score(log, offset=fit.offset) == fit.fitted
    # Another window of the record begins as it does.
    assert loaded.start_on(log[1.0:]) == fit.start


def test_another_record_shows_its_own_history() -> None:
    fit = fitted(record([75.0]))
    other = record([70.0], seed=1, amplitude=30.0)
    assert fit.score(other).rms < 3.0 * NOISE
    assert fit.start_on(other).history == "fit"
    assert fit.score(other, history="virgin").rms > 10.0 * NOISE
    with pytest.raises(pt.ParameterError, match="history is 'virgin' beside an initial state"):
        fit.score(other, history="virgin", initial=STAGE.equilibrium(40.0))


def test_creep_of_another_record_is_where_it_fits() -> None:
    stage = pt.PrandtlIshlinskiiStage(
        linear=1e-6,
        thresholds=(5.0, 15.0),
        weights=(2e-7, 2e-7),
        creep_weights=(0.05,),
        creep_times=(1.0,),
    )
    model = pt.identification.IdentifiedModel(
        model=stage, offset=0.0, offset_fitted=True, stroke=1e-4
    )
    t = DT * np.arange(3000)
    u = 40.0 + 20.0 * np.sin(2.0 * np.pi * t)
    begun = stage.equilibrium([70.0, 40.0])
    # Not long enough at 40 V for the creep from 70 V to be complete.
    crept = stage.simulate([40.0] * 500, DT, initial=stage.equilibrium(70.0)).final
    assert crept.creep != pytest.approx(begun.creep, rel=1e-3)
    log = pt.Dataset(u=u, y=stage.simulate(u, DT, initial=crept).x, dt=DT)
    assert model.score(log).rms < 1e-9
    assert model.start_on(log).history == "fit"


@pytest.mark.parametrize("history", ["new", 1, ""])
def test_a_history_that_there_is_not_is_refused(history: Any) -> None:
    with pytest.raises(pt.ParameterError, match="expected 'virgin', 'settled', 'fit', or None"):
        pt.identify(record([]), "first-order-dahl", history=history)


def test_a_file_with_another_state_is_refused(tmp_path: Path) -> None:
    fit = pt.identification.IdentifiedModel(
        model=STAGE,
        offset=0.0,
        offset_fitted=True,
        stroke=1e-4,
        start=pt.identification.IdentifiedModel(
            model=STAGE, offset=0.0, offset_fitted=True, stroke=1e-4
        ).start_on(record([]), history="virgin"),
    )
    path = fit.save(tmp_path / "model.json")
    text = path.read_text(encoding="utf-8")
    for old, new in (('"force"', '"plays"'), ('"virgin"', '"never"'), ('"state": {', '"stat": {')):
        path.write_text(text.replace(old, new), encoding="utf-8")
        with pytest.raises(pt.DataError, match=r"model\.json"):
            pt.load(path)
