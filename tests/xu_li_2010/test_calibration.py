"""The calibration of the apparatus: its file, its cost, its free parameters, its swarm."""

from __future__ import annotations

import numpy as np
import pytest

import piezotrack as pt
from piezotrack import _core
from piezotrack.xu_li_2010.apparatus import Apparatus, calibration_file
from piezotrack.xu_li_2010.calibration import calibrate, cost, medians
from piezotrack.xu_li_2010.experiments import fig_06_identification
from piezotrack.xu_li_2010.free_parameters import FREE, Free, apparatus_at
from piezotrack.xu_li_2010.published import observables


@pytest.mark.slow
def test_the_file_is_what_the_calibration_gives() -> None:
    document = calibration_file()
    theta = {one["name"]: one["value"] for one in document["free"]}
    apparatus = apparatus_at(theta)
    # The file has what the report loads.
    loaded, made = Apparatus.calibrated().plays_of_x, apparatus.plays_of_x
    assert loaded.weights == pytest.approx(made.weights, rel=1e-9)
    values = medians(theta, document["provenance"]["sensor_seeds"])
    for one in document["observables"]:
        assert values[one["key"]] == pytest.approx(one["obtained"], rel=1e-6), one["key"]
    assert cost(values) == pytest.approx(document["provenance"]["cost"], rel=1e-6)


def test_table_1_tells_the_sign_of_the_asymmetry() -> None:
    theta = {one["name"]: one["value"] for one in calibration_file()["free"]}
    turned = {**theta, "bend_x": -theta["bend_x"], "top_x": -theta["top_x"]}
    logs = [
        fig_06_identification.thinned(fig_06_identification.record(apparatus_at(one)), 10)
        for one in (theta, turned)
    ]
    stiffness, other = (
        fig_06_identification.observe(fig_06_identification.search(log, 1))["table_1.stiffness"]
        for log in logs
    )
    assert stiffness == pytest.approx(26065.0, rel=0.25)
    assert other > 1.3 * stiffness


def test_what_agrees_costs_nothing() -> None:
    exact = {one.key: one.published for one in observables()}
    assert cost(exact) == 0.0
    assert cost({**exact, "both.max": 1.0e-6, "windup.without": 1.0}) == 0.0
    # One goal off is half of one missed; one that is far off counts for one, however far.
    counted = sum(one.calibrated for one in observables())
    off = cost({**exact, "forward.max": 1.15 * 5.69e-6})
    assert off == pytest.approx(0.5 / counted)
    assert cost({**exact, "forward.max": 1.0}) == pytest.approx(1.0 / counted)


@pytest.mark.parametrize(
    ("share", "slope", "reach"), [(0.1, 0.0, 1.0), (0.2, 2.0, 1.0), (0.1, 1.0, 0.5)]
)
def test_the_share_is_the_widest_loop(share: float, slope: float, reach: float) -> None:
    theta = {one["name"]: one["value"] for one in calibration_file()["free"]}
    theta |= {"share_x": share, "slope_x": slope, "reach_x": reach, "bend_x": 0.0, "top_x": 0.0}
    theta |= {"creep_fast_x": 0.0, "creep_1s_x": 0.0, "creep_10s_x": 0.0}
    stage = apparatus_at(theta).x
    up = np.linspace(0.0, 75.0, 4001)
    x = stage.simulate(np.concatenate([up, up[::-1]]), 1e-3).x
    there, back = x[:4001], x[4001:][::-1]
    assert x.max() == pytest.approx(117.7622e-6, rel=1e-3)
    assert (back - there).max() / np.ptp(there) == pytest.approx(share, rel=0.02)


def test_later_boxes_are_about_the_best_and_within_the_first() -> None:
    free = Free("a", 0.0, 6.0, "")
    assert (free.about(3.0, 0.5).low, free.about(3.0, 0.5).high) == (1.5, 4.5)
    assert (free.about(0.5, 0.5).low, free.about(5.5, 0.5).high) == (0.0, 6.0)
    scaled = Free("a", 1.0, 100.0, "", scaled=True)
    assert (scaled.at(0.5), scaled.part(10.0)) == pytest.approx((10.0, 0.5))
    box = scaled.about(10.0, 0.5)
    assert (box.low, box.high) == pytest.approx((10**0.5, 10**1.5))


def test_each_free_parameter_is_one_of_the_apparatus() -> None:
    theta = {one["name"]: one["value"] for one in calibration_file()["free"]}
    assert sorted(theta) == sorted(one.name for one in FREE)
    known = apparatus_at(theta).document()
    for parameter in FREE:
        assert parameter.low <= theta[parameter.name] <= parameter.high
        # x and y have their own, but for what they share.
        moved = apparatus_at({**theta, parameter.name: parameter.at(0.37)}).document()
        changed = {key for key in known if moved[key] != known[key]}
        if parameter.name.endswith(("_x", "_y")) and not parameter.name.startswith("cross"):
            assert changed == {parameter.name[-1]}, parameter.name
        else:
            assert changed, parameter.name


@pytest.mark.slow
def test_a_calibration_goes_from_end_to_end() -> None:
    seen: list[float] = []
    calibration = calibrate(
        particles=2, iterations=1, runs=1, progress=lambda _, least, __: seen.append(least)
    )
    # Three swarms, each told twice. The last is judged by medians over three seeds, as the best
    # before it then is, and the better of the two is described.
    assert len(seen) == 6
    provenance = calibration["provenance"]
    assert provenance["costs"][0] == seen[1]
    assert provenance["costs"][1] <= min(seen[1], seen[3])
    assert provenance["cost"] == provenance["costs"][2] <= seen[5]
    assert provenance["sensor_seeds"] == [1, 2, 3]
    obtained = {one["key"]: one["obtained"] for one in calibration["observables"]}
    assert cost(obtained) == pytest.approx(provenance["cost"], rel=1e-9)
    assert Apparatus.of(calibration["apparatus"]).document() == calibration["apparatus"]


def test_the_swarm_finds_the_bottom_of_a_bowl() -> None:
    settings = pt.ParticleSwarm(particles=20, iterations=80, stall_iterations=80)
    swarm = _core.Swarm(settings._core, 3, 1)
    bottom = np.array([0.2, 0.5, 0.9])
    while not swarm.done:
        places = swarm.ask()
        swarm.tell([float(np.sum((np.array(p) - bottom) ** 2)) for p in places if p is not None])
    place, cost = swarm.best
    assert np.allclose(place, bottom, atol=1e-3)
    assert cost == pytest.approx(np.sum((np.array(place) - bottom) ** 2), rel=1e-9)


def test_the_swarm_refuses_no_coordinates() -> None:
    with pytest.raises(pt.ParameterError, match="coordinates"):
        _core.Swarm(pt.ParticleSwarm()._core, 0, 1)
