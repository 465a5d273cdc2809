"""The cost of an identification as a function of the unit box, and descents on it."""

from __future__ import annotations

import dataclasses
import os
import signal
import threading
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from numpy.typing import NDArray

STAGE = pt.DahlStage.xu_li_2010()
HELD = {"mass": STAGE.mass, "a1": STAGE.a1, "a2": STAGE.a2, "b1": STAGE.b1}


def log() -> pt.Dataset:
    t = np.arange(500) / 125.0
    u = 37.5 * (1.0 - np.cos(0.5 * np.pi * t))
    return pt.Dataset(u=u, y=STAGE.simulate(u, 1 / 125.0).x + 2e-6, dt=1 / 125.0)


def objective(
    threads: int | None = None, **parameters: pt.Parameter
) -> pt.identification.Objective:
    return pt.identification.Objective(
        log(), "dahl", parameters={**HELD, **parameters}, threads=threads
    )


def places(count: int, cost: pt.identification.Objective) -> NDArray[np.float64]:
    return np.random.default_rng(1).random((count, len(cost.ranges)))


def test_a_cost_is_the_deviation_of_the_public_simulation() -> None:
    cost = objective()
    for place in places(5, cost):
        stage = dataclasses.replace(STAGE, **cast("dict[str, Any]", cost.parameters(place)))
        # The search steps to within 0.2 nm, and fits the offset.
        expected = np.std(log().y - stage.simulate(log().u, log().dt).x)
        assert cost(place) == pytest.approx([expected], abs=5e-10)


def test_descents_follow_a_valley_that_bends() -> None:
    """Of Levenberg-Marquardt alone all but one are still in the valley after 60 iterations."""
    log = pt.datasets.dbo_training()[3.0:23.0]
    cost = pt.identification.Objective(log, "asymmetric-bouc-wen", history="settled")
    _, costs, _ = cost.descend(places(16, cost))
    assert np.sum(costs < 1.002 * costs.min()) >= 14


def test_a_place_goes_through_the_bounds() -> None:
    cost = objective(stiffness=pt.Parameter(bounds=(2e4, 3e4), scale="linear"))
    assert cost.ranges["stiffness"] == (2e4, 3e4)
    k = list(cost.ranges).index("stiffness")
    place = np.full(len(cost.ranges), 0.5)
    for z, expected in ((0.0, 2e4), (0.25, 2.25e4), (1.0, 3e4)):
        place[k] = z
        assert cost.parameters(place)["stiffness"] == pytest.approx(expected)


def test_descents_find_what_made_the_record_and_never_go_up() -> None:
    cost = objective()
    starts = places(8, cost)
    ends, costs, used = cost.descend(starts)
    assert ends.shape == starts.shape
    assert (costs <= cost(starts)).all()
    assert costs.tolist() == cost(ends).tolist()
    # A start that diverges has no way down.
    assert (used[np.isfinite(costs)] > len(cost.ranges)).all()
    found = cost.parameters(ends[np.argmin(costs)])
    assert found["stiffness"] == pytest.approx(STAGE.stiffness, rel=1e-4)
    assert costs.min() < 1e-9


def test_threads_and_company_make_no_difference() -> None:
    one, two = objective(threads=1), objective(threads=2)
    at = places(20, one)
    assert one(at).tolist() == two(at).tolist() == [float(one(place)[0]) for place in at]


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ([0.5, 0.5], "coordinates of a place is 2: expected 3, one for each searched parameter"),
        ([0.5, 0.5, 1.5], "coordinate of a place is 1.5: expected 0 to 1"),
        ([0.5, 0.5, np.nan], "coordinate of a place is NaN: expected 0 to 1"),
        ([[[0.5, 0.5, 0.5]]], "places have 3 dimensions: expected one row"),
    ],
)
def test_places_outside_of_the_box_are_refused(place: Any, expected: str) -> None:
    with pytest.raises(pt.ParameterError, match=expected):
        objective()(place)


def test_a_model_that_is_not_searched_has_no_box() -> None:
    with pytest.raises(pt.ParameterError, match="expected one that is searched"):
        pt.identification.Objective(log(), "prandtl-ishlinskii")


@pytest.mark.skipif(os.name == "nt", reason="Windows sends no signal to its own process")
def test_ctrl_c_is_raised_and_no_costs_are_made_up() -> None:
    """So many costs take ten seconds."""
    once = log()
    u, y = np.tile(once.u, 100), np.tile(once.y, 100)
    cost = pt.identification.Objective(pt.Dataset(u=u, y=y, dt=once.dt), "dahl", parameters=HELD)
    many = places(200_000, cost)
    threading.Timer(1.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        cost(many)
