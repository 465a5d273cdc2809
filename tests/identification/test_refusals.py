"""What an identification refuses, in words."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from records import (
    HELD,
    TABLE_1,
    quick,
)

if TYPE_CHECKING:
    from collections.abc import Callable

SMALL = pt.ParticleSwarm(particles=4, iterations=2, polish=False)


def constant_drive() -> pt.Dataset:
    return pt.Dataset(u=np.full(1001, 2.0), y=quick().y, dt=1 / 250.0)


def dead_sensor() -> pt.Dataset:
    return pt.Dataset(u=quick().u, y=np.full(1001, 1e-6), dt=1 / 250.0)


def constant_in_the_window() -> pt.Dataset:
    u = np.concatenate([quick().u, np.zeros(1001)])
    return pt.Dataset(u=u, y=np.concatenate([quick().y, quick().y]), dt=1 / 250.0)[4.004:]


def dead_in_the_window() -> pt.Dataset:
    y = np.concatenate([quick().y, np.zeros(1001)])
    return pt.Dataset(u=np.concatenate([quick().u, quick().u]), y=y, dt=1 / 250.0)[4.004:]


BAD_RECORDS: dict[str, tuple[Callable[[], pt.Dataset], str]] = {
    "constant drive": (constant_drive, "the drive is constant at 2 V in the window: expected"),
    "dead sensor": (dead_sensor, "the displacement is constant at .* sensor seems dead"),
    "constant in the window": (constant_in_the_window, "the drive is constant at 0 V"),
    "dead in the window": (dead_in_the_window, "the displacement is constant at 0 m"),
    "a short window": (lambda: quick()[1.0:1.02], "the window has 5 samples: expected at least"),
}


@pytest.mark.parametrize("name", BAD_RECORDS)
def test_refuses_a_record_that_tells_nothing(name: str) -> None:
    record, message = BAD_RECORDS[name]
    with pytest.raises(pt.DataError, match=message):
        pt.identify(record())


FORCES = ["mass", "damping", "stiffness", "piezo_coefficient", "b1"]

# The arguments, and what the message has to contain.
BAD_ARGUMENTS: list[tuple[dict[str, Any], tuple[str, ...]]] = [
    ({"data": (quick().u, quick().y)}, ("data is tuple", "expected a Dataset")),
    ({"data": "stage.csv"}, ("data is str", "expected a Dataset", "pt.read")),
    ({"data": None}, ("data is NoneType", "expected a Dataset")),
    ({"model": "unknown"}, ("model is 'unknown'", "'dahl'")),
    ({"model": None}, ("model is None", "'dahl'")),
    # Bounds.
    ({"bounds": {"mass": (0.2, 0.1)}}, ("bounds of mass", "(0.2, 0.1)", "lower one first")),
    ({"bounds": {"mass": (0.2, 0.2)}}, ("bounds of mass", "(0.2, 0.2)", "lower one first")),
    ({"bounds": {"mass": (0.1, math.inf)}}, ("bounds of mass", "inf", "finite")),
    ({"bounds": {"mass": (math.nan, 0.2)}}, ("bounds of mass", "finite")),
    ({"bounds": {"mass": (-0.1, 0.2)}}, ("mass", "-0.1", "above 0")),
    ({"bounds": {"damping": (-5.0, 10.0)}}, ("damping", "-5", "0 or above")),
    ({"bounds": {"mass": 0.1}}, ("bounds of mass", "0.1", "(low, high)")),
    ({"bounds": {"mass": "ab"}}, ("bounds of mass", "'ab'", "(low, high)")),
    ({"bounds": {"mass": (1.0, 2.0, 3.0)}}, ("bounds of mass", "(low, high)")),
    ({"bounds": {"mass": (None, 2.0)}}, ("bound of mass", "None", "a number")),
    ({"bounds": {"weight": (0.1, 0.2)}}, ("bounds", "'weight'", "one of mass, damping")),
    ({"bounds": {"a1": (1.0, 2.0)}, "fixed": HELD}, ("bounds of a1", "not free")),
    ({"bounds": {"up": (1.0, 2.0)}}, ("bounds of up", "not free")),
    ({"bounds": {"stiffness": (1e4, 5e4)}}, ("bounds of stiffness", "stiffness=", "fixed=")),
    # What is held.
    ({"fixed": {"weight": 1.0}}, ("fixed", "'weight'", "one of mass, damping")),
    ({"fixed": {"mass": -1.0}}, ("mass", "-1", "above 0")),
    ({"fixed": {"mass": 0.0}}, ("mass", "0", "above 0")),
    ({"fixed": {"damping": -1.0}}, ("damping", "-1", "0 or above")),
    ({"fixed": {"stiffness": -1.0}}, ("stiffness", "-1", "above 0")),
    ({"fixed": {"piezo_coefficient": 0.0}}, ("piezo_coefficient", "0", "other than 0")),
    ({"fixed": {"a1": -1.0}}, ("a1", "-1", "0 or above")),
    ({"fixed": {"a2": -1.0}}, ("a2", "-1", "0 or above")),
    ({"fixed": {"mass": math.nan}}, ("mass", "NaN", "finite")),
    ({"fixed": {"b1": math.inf}}, ("b1", "inf", "finite")),
    ({"fixed": {"mass": "1"}}, ("mass", "'1'", "a number")),
    ({"fixed": {"mass": True}}, ("mass", "True", "a number")),
    ({"fixed": {"b0": math.inf}}, ("b0", "inf", "finite")),
    # The delay.
    ({"delay": -1e-3}, ("delay is -0.001 s", "0 s or above")),
    ({"delay": math.nan}, ("delay is NaN s", "0 s or above")),
    ({"delay": 1e3}, ("delay is 1000 s", "below the record's")),
    ({"delay": (0.0, 1e3)}, ("delay is (0, 1000) s", "below the record's")),
    ({"delay": (2e-3, 1e-3)}, ("bounds of delay", "the lower one first")),
    ({"delay": (1e-3, 1e-3)}, ("bounds of delay", "the lower first")),
    ({"delay": "long"}, ("delay is 'long'", "a number")),
    ({"fixed": {"up": 0.0}}, ("up", "0")),
    # What is free.
    ({"free": ["weight"]}, ("free", "'weight'", "one of mass, damping")),
    ({"free": "mass"}, ("free is 'mass'", "a list")),
    ({"free": [5]}, ("free", "5", "one of mass, damping")),
    ({"free": ["up"]}, ("free is up", "b1 up")),
    ({"free": ["mass"], "fixed": {"mass": 0.2}}, ("free is mass", "not fixed as well")),
    ({"free": ["stiffness"], "stiffness": 1e4}, ("free is stiffness", "not fixed as well")),
    ({"free": ["mass", "damping"]}, ("free", "piezo_coefficient", "fixed=")),
    ({"free": []}, ("free is", "mass", "fixed=")),
    ({"free": [*FORCES, "a1", "a2"]}, ("free is", "carries force", "stiffness=", "fixed=")),
    ({"fixed": asdict(TABLE_1)}, ("free is empty", "at least one")),
    # The rest.
    ({"stiffness": 0.0}, ("stiffness is 0 N/m", "above 0")),
    ({"stiffness": -1.0}, ("stiffness is -1 N/m", "above 0")),
    ({"stiffness": math.nan}, ("stiffness is NaN", "above 0")),
    ({"stiffness": "stiff"}, ("stiffness is 'stiff'", "a number")),
    ({"stiffness": 2.0, "fixed": {"stiffness": 3.0}}, ("stiffness is 2 N/m", "fixed=")),
    ({"seed": -1}, ("seed is -1", "a whole number, 0 or above")),
    ({"seed": 1.5}, ("seed is 1.5", "a whole number")),
    ({"least_squares": pt.identification.LeastSquares()}, ("least_squares is", "a swarm searches")),
    ({"seed": "1"}, ("seed is '1'", "a whole number")),
    ({"runs": 0}, ("runs is 0", "1 or more")),
    ({"runs": "2"}, ("runs is '2'", "a whole number")),
    ({"threads": "two"}, ("threads is 'two'", "a whole number")),
    ({"threads": -1}, ("threads is -1", "a whole number")),
]


# Of another type than asked for.
WRONG_TYPES: list[tuple[dict[str, Any], tuple[str, ...]]] = [
    ({"bounds": [("mass", (0.1, 0.2))]}, ("bounds", "mapping")),
    ({"bounds": {1: (0.1, 0.2)}}, ("bounds", "1", "one of mass, damping")),
    ({"fixed": ["mass"]}, ("fixed", "mapping")),
    ({"fixed": {1: 2.0}}, ("fixed", "1", "one of mass, damping")),
    ({"free": 5}, ("free is 5",)),
    ({"offset": "no"}, ("offset is 'no'", "True or False")),
    ({"swarm": "paper"}, ("swarm is", "ParticleSwarm")),
    ({"swarm": pt.ParticleSwarm}, ("swarm is", "ParticleSwarm")),
    ({"callback": 5}, ("callback is 5",)),
]
BAD = [*BAD_ARGUMENTS, *WRONG_TYPES]


@pytest.mark.parametrize(("arguments", "pieces"), BAD, ids=[", ".join(p) for _, p in BAD])
def test_refuses_a_bad_argument(arguments: dict[str, Any], pieces: tuple[str, ...]) -> None:
    arguments = {"data": quick(), "swarm": SMALL, **arguments}
    with pytest.raises(pt.ParameterError) as caught:
        pt.identify(arguments.pop("data"), **arguments)
    for piece in pieces:
        assert piece in str(caught.value)
    assert "\n" not in str(caught.value)


BAD_SETTINGS: list[tuple[str, Any, str]] = [
    ("particles", 1, "2 or more"),
    ("particles", 0, "2 or more"),
    ("particles", -1, "a whole number"),
    ("particles", 2.5, "a whole number"),
    ("iterations", 0, "1 or more"),
    ("inertia_start", -0.1, "0 or above"),
    ("inertia_start", math.nan, "0 or above"),
    ("inertia_end", math.inf, "finite"),
    ("inertia_iterations", -1, "a whole number"),
    ("cognitive", -1.0, "0 or above"),
    ("cognitive", "2", "a number"),
    ("social", math.nan, "0 or above"),
    ("update", "bare-bones", "'classic', 'hypersphere' or 'hypersphere-radial'"),
    ("update", None, "'classic', 'hypersphere' or 'hypersphere-radial'"),
    ("topology", "star", "'global', 'ring' or 'random'"),
    ("topology", None, "'ring'"),
    ("velocity_limit", 0.0, "above 0"),
    ("velocity_limit", -1.0, "above 0"),
    ("velocity_limit", math.nan, "above 0"),
    ("boundary", "bounce", "'absorb', 'rebound', 'reflect' or 'invisible'"),
    ("boundary", 1, "'absorb', 'rebound', 'reflect' or 'invisible'"),
    ("min_improvement", -1.0, "0 or above"),
    ("min_improvement", math.nan, "0 or above"),
    ("stall_iterations", 0, "1 or more"),
    ("polish", "yes", "True or False"),
]


@pytest.mark.parametrize(("name", "value", "expected"), BAD_SETTINGS)
def test_refuses_a_bad_setting_of_the_swarm(name: str, value: Any, expected: str) -> None:
    with pytest.raises(pt.ParameterError) as caught:
        pt.ParticleSwarm(**{name: value})
    message = str(caught.value)
    assert message.startswith(f"{name} is ")
    assert expected in message
