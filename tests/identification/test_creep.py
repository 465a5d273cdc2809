"""Creep found with the parameters that a swarm searches."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from pathlib import Path

STAGE = pt.FirstOrderDahlStage(
    mass=0.1828,
    damping=500.0,
    stiffness=26065.0,
    piezo_coefficient=0.0468,
    rest_stiffness=9e3,
    coulomb_force=0.15,
    creep_weights=(0.02, 0.03),
    creep_times=(0.3, 4.0),
)
# Only a few are searched: the shares are what counts here.
HELD = {"mass": 0.1828, "stiffness": 26065.0, "rest_stiffness": 9e3, "coulomb_force": 0.15}
DT = 0.01


def record(stage: Any = STAGE, offset: float = 3e-6) -> pt.Dataset:
    """Steps and waves from rest."""
    t = DT * np.arange(1500)
    u = 37.5 * (1 - np.cos(2 * np.pi * 0.5 * t)) * np.where((t > 5.0) & (t < 9.0), 0.3, 1.0)
    return pt.Dataset(u=u, y=stage.simulate(u, DT).x + offset, dt=DT)


@cache
def found(
    *creep: float, offset: bool = True, delay: float = 0.0
) -> pt.identification.Identification:
    return pt.identify(
        record(offset=3e-6 if offset else 0.0),
        "first-order-dahl",
        fixed=HELD,
        creep=creep,
        offset=offset,
        delay=delay,
        runs=1,
        swarm=pt.ParticleSwarm(iterations=20, particles=16),
    )


@pytest.mark.parametrize("offset", [True, False])
def test_finds_the_weights(offset: bool) -> None:
    fit = found(0.3, 4.0, offset=offset)
    model = fit.model
    assert model.creep_times == (0.3, 4.0)
    assert model.creep_weights == pytest.approx((0.02, 0.03), rel=2e-3)
    assert model.piezo_coefficient == pytest.approx(0.0468, rel=1e-4)
    assert model.damping == pytest.approx(500.0, rel=1e-2)
    assert fit.offset == pytest.approx(3e-6 if offset else 0.0, abs=1e-9)
    assert fit.cost < 1e-9


def test_without_creep_the_record_is_not_followed() -> None:
    assert found().model.creep_weights == ()
    assert found().cost > 100.0 * found(0.3, 4.0).cost


@pytest.mark.parametrize("delay", [0.0, 0.004])
@pytest.mark.parametrize("creep", [(0.1,), (0.02, 0.3, 8.0)])
def test_the_cost_of_the_search_is_that_of_the_stage(
    creep: tuple[float, ...], delay: float
) -> None:
    fit = found(*creep, delay=delay)
    # The swarm steps to within 0.2 nm.
    assert fit.score(record()).rms == pytest.approx(fit.cost, abs=2e-10)


def test_the_weights_are_those_of_linear_least_squares() -> None:
    """Small changes of a weight, the offset following, make the rest of the fit worse."""
    fit = found(0.1, 1.0)
    for j in range(2):
        for change in (-1e-3, 1e-3):
            weights = list(fit.model.creep_weights)
            weights[j] += change
            if weights[j] < 0.0:
                continue
            x = replace(fit.model, creep_weights=weights).simulate(record().u, DT).x
            assert np.std(record().y - x) > fit.cost


def test_the_weights_stay_below_a_half() -> None:
    # All of the motion is delayed: what no creep is.
    slow = replace(STAGE, creep_weights=(2.0,), creep_times=(1.0,))
    fit = pt.identify(
        record(slow), "first-order-dahl", fixed=HELD, creep=[0.5, 1.0], runs=1,
        swarm=pt.ParticleSwarm(iterations=20, particles=16),
    )  # fmt: skip
    assert min(fit.model.creep_weights) >= 0.0
    assert sum(fit.model.creep_weights) == pytest.approx(0.5, abs=1e-9)


def test_time_constants_from_the_record() -> None:
    swarm = pt.ParticleSwarm(iterations=1, particles=4, polish=False)
    options: dict[str, Any] = {"fixed": HELD, "runs": 1, "swarm": swarm, "creep": True}
    fit = pt.identify(record(), "first-order-dahl", **options)
    assert fit.model.creep_times == pytest.approx((2.0, 7.5), rel=0.1)
    short = pt.Dataset(u=record().u[:399], y=record().y[:399], dt=DT)
    with pytest.raises(pt.DataError, match="the window has 399 samples: expected at least 400"):
        pt.identify(short, "first-order-dahl", **options)


@pytest.mark.parametrize(
    ("creep", "message"),
    [
        ("yes", "creep is 'yes': expected True, False or time constants in seconds"),
        (0.1, "creep is 0.1: expected True, False or time constants in seconds"),
        ([1.0, 0.0], r"creep\[1\] is 0 s"),
        ([1.0, 2.0, 3.0, 4.0], "creep is 4 entries: expected 3 time constants at most"),
    ],
)
def test_refuses(creep: Any, message: str) -> None:
    with pytest.raises(pt.ParameterError, match=message):
        pt.identify(record(), "first-order-dahl", creep=creep)


def test_of_models_found_by_least_squares_it_is_a_setting() -> None:
    with pytest.raises(pt.ParameterError, match="creep is True: expected none with the model"):
        pt.identify(record(), "prandtl-ishlinskii", creep=True)
    with pytest.raises(pt.ParameterError, match="fixed is 'creep_weights': expected one of mass"):
        pt.identify(record(), "first-order-dahl", fixed={"creep_weights": 0.1})


def test_a_model_file_keeps_it_and_older_ones_have_none(tmp_path: Path) -> None:
    fit = found(0.3, 4.0)
    path = fit.save(tmp_path / "model.json")
    assert pt.load(path).model == fit.model
    content = json.loads(path.read_text())
    for name in ("creep_weights", "creep_times"):
        del content["parameters"][name]
    path.write_text(json.dumps(content))
    assert pt.load(path).model == replace(fit.model, creep_weights=(), creep_times=())


def test_the_summary_lists_it() -> None:
    assert "creep_weights c" in found(0.3, 4.0).summary()
    assert "creep" not in found().summary()
