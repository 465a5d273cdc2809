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

# The arguments, and the name that the message begins with.
BAD_ARGUMENTS: list[tuple[dict[str, Any], str]] = [
    ({"data": (quick().u, quick().y)}, "data"),
    ({"data": "stage.csv"}, "data"),
    ({"data": None}, "data"),
    ({"model": "unknown"}, "model"),
    ({"model": None}, "model"),
    # Bounds.
    ({"bounds": {"mass": (0.2, 0.1)}}, "bounds of mass"),
    ({"bounds": {"mass": (0.2, 0.2)}}, "bounds of mass"),
    ({"bounds": {"mass": (0.1, math.inf)}}, "bounds of mass"),
    ({"bounds": {"mass": (math.nan, 0.2)}}, "bounds of mass"),
    ({"bounds": {"mass": (-0.1, 0.2)}}, "mass"),
    ({"bounds": {"damping": (-5.0, 10.0)}}, "damping"),
    ({"bounds": {"mass": 0.1}}, "bounds of mass"),
    ({"bounds": {"mass": "ab"}}, "bounds of mass"),
    ({"bounds": {"mass": (1.0, 2.0, 3.0)}}, "bounds of mass"),
    ({"bounds": {"mass": (None, 2.0)}}, "lower bound of mass"),
    ({"bounds": {"weight": (0.1, 0.2)}}, "bounds"),
    ({"bounds": {"a1": (1.0, 2.0)}, "fixed": HELD}, "bounds of a1"),
    ({"bounds": {"up": (1.0, 2.0)}}, "bounds of up"),
    ({"bounds": {"stiffness": (1e4, 5e4)}}, "bounds of stiffness"),
    # What is held.
    ({"fixed": {"weight": 1.0}}, "fixed"),
    ({"fixed": {"mass": -1.0}}, "mass"),
    ({"fixed": {"mass": 0.0}}, "mass"),
    ({"fixed": {"damping": -1.0}}, "damping"),
    ({"fixed": {"stiffness": -1.0}}, "stiffness"),
    ({"fixed": {"piezo_coefficient": 0.0}}, "piezo_coefficient"),
    ({"fixed": {"a1": -1.0}}, "a1"),
    ({"fixed": {"a2": -1.0}}, "a2"),
    ({"fixed": {"mass": math.nan}}, "fixed mass"),
    ({"fixed": {"b1": math.inf}}, "fixed b1"),
    ({"fixed": {"mass": "1"}}, "mass"),
    ({"fixed": {"mass": True}}, "mass"),
    ({"fixed": {"b0": math.inf}}, "fixed b0"),
    # The delay.
    ({"delay": -1e-3}, "delay"),
    ({"delay": math.nan}, "delay"),
    ({"delay": 1e3}, "delay"),
    ({"delay": (0.0, 1e3)}, "delay"),
    ({"delay": (2e-3, 1e-3)}, "bounds of delay"),
    ({"delay": (1e-3, 1e-3)}, "bounds of delay"),
    ({"delay": "long"}, "delay"),
    ({"fixed": {"up": 0.0}}, "up"),
    # What is free.
    ({"free": ["weight"]}, "free"),
    ({"free": "mass"}, "free"),
    ({"free": [5]}, "free"),
    ({"free": ["up"]}, "free"),
    ({"free": ["mass"], "fixed": {"mass": 0.2}}, "free"),
    ({"free": ["stiffness"], "stiffness": 1e4}, "free"),
    ({"free": ["mass", "damping"]}, "free"),
    ({"free": []}, "free"),
    ({"free": [*FORCES, "a1", "a2"]}, "free"),
    ({"fixed": asdict(TABLE_1)}, "free"),
    # The rest.
    ({"stiffness": 0.0}, "stiffness"),
    ({"stiffness": -1.0}, "stiffness"),
    ({"stiffness": math.nan}, "stiffness"),
    ({"stiffness": "stiff"}, "stiffness"),
    ({"stiffness": 2.0, "fixed": {"stiffness": 3.0}}, "stiffness"),
    ({"seed": -1}, "seed"),
    ({"seed": 1.5}, "seed"),
    ({"least_squares": pt.identification.LeastSquares()}, "least_squares"),
    ({"seed": "1"}, "seed"),
    ({"runs": 0}, "runs"),
    ({"runs": "2"}, "runs"),
    ({"threads": "two"}, "threads"),
    ({"threads": -1}, "threads"),
]


# Of another type than asked for.
WRONG_TYPES: list[tuple[dict[str, Any], str]] = [
    ({"bounds": [("mass", (0.1, 0.2))]}, "bounds"),
    ({"bounds": {1: (0.1, 0.2)}}, "bounds"),
    ({"fixed": ["mass"]}, "fixed"),
    ({"fixed": {1: 2.0}}, "fixed"),
    ({"free": 5}, "free"),
    ({"offset": "no"}, "offset"),
    ({"swarm": "paper"}, "swarm"),
    ({"swarm": pt.ParticleSwarm}, "swarm"),
    ({"callback": 5}, "callback"),
]
BAD = [*BAD_ARGUMENTS, *WRONG_TYPES]


def refused(arguments: dict[str, Any]) -> str:
    """The message with which arguments of `identify` are refused."""
    arguments = {"data": quick(), "model": "dahl", "swarm": SMALL, **arguments}
    with pytest.raises(pt.ParameterError) as caught:
        pt.identify(arguments.pop("data"), **arguments)
    return str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "name"), BAD, ids=[f"{row}-{name}" for row, (_, name) in enumerate(BAD)]
)
def test_refuses_a_bad_argument(arguments: dict[str, Any], name: str) -> None:
    message = refused(arguments)
    assert message.startswith((f"{name} is ", f"{name} are "))
    assert ": expected " in message
    assert "\n" not in message


def test_the_wording_of_a_refusal() -> None:
    expected = "bounds of mass is (0.2, 0.1): expected two finite numbers, the lower one first"
    assert refused({"bounds": {"mass": (0.2, 0.1)}}) == expected


BAD_SETTINGS: list[tuple[str, Any]] = [
    ("particles", 1),
    ("particles", 0),
    ("particles", -1),
    ("particles", 2.5),
    ("iterations", 0),
    ("inertia_start", -0.1),
    ("inertia_start", math.nan),
    ("inertia_end", math.inf),
    ("inertia_iterations", -1),
    ("cognitive", -1.0),
    ("cognitive", "2"),
    ("social", math.nan),
    ("update", "bare-bones"),
    ("update", None),
    ("topology", "star"),
    ("topology", None),
    ("velocity_limit", 0.0),
    ("velocity_limit", -1.0),
    ("velocity_limit", math.nan),
    ("boundary", "bounce"),
    ("boundary", 1),
    ("min_improvement", -1.0),
    ("min_improvement", math.nan),
    ("stall_iterations", 0),
    ("polish", "yes"),
]


@pytest.mark.parametrize(("name", "value"), BAD_SETTINGS)
def test_refuses_a_bad_setting_of_the_swarm(name: str, value: Any) -> None:
    with pytest.raises(pt.ParameterError, match=f"^{name} is .*: expected "):
        pt.ParticleSwarm(**{name: value})
