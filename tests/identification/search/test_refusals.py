"""What an identification refuses, in words."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from records import TABLE_1, quick

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
    ({"parameters": {"mass": (0.2, 0.1)}}, "bounds of mass"),
    ({"parameters": {"mass": (0.2, 0.2)}}, "bounds of mass"),
    ({"parameters": {"mass": (0.1, math.inf)}}, "bounds of mass"),
    ({"parameters": {"mass": (math.nan, 0.2)}}, "bounds of mass"),
    ({"parameters": {"mass": (-0.1, 0.2)}}, "mass"),
    ({"parameters": {"damping": (-5.0, 10.0)}}, "damping"),
    ({"parameters": {"mass": "ab"}}, "tie of mass"),
    ({"parameters": {"mass": (1.0, 2.0, 3.0)}}, "bounds of mass"),
    ({"parameters": {"mass": (None, 2.0)}}, "lower bound of mass"),
    ({"parameters": {"weight": (0.1, 0.2)}}, "parameters"),
    ({"parameters": {"a1": pt.Parameter(1.0, bounds=(1.0, 2.0))}}, "bounds of a1"),
    ({"parameters": {"up": (1.0, 2.0)}}, "parameters"),
    ({"parameters": {"stiffness": (1e4, 5e4)}}, "bounds of stiffness"),
    # What is held.
    ({"parameters": {"weight": 1.0}}, "parameters"),
    ({"parameters": {"mass": -1.0}}, "mass"),
    ({"parameters": {"mass": 0.0}}, "mass"),
    ({"parameters": {"damping": -1.0}}, "damping"),
    ({"parameters": {"stiffness": -1.0}}, "stiffness"),
    ({"parameters": {"piezo_coefficient": 0.0}}, "piezo_coefficient"),
    ({"parameters": {"a1": -1.0}}, "a1"),
    ({"parameters": {"a2": -1.0}}, "a2"),
    ({"parameters": {"mass": math.nan}}, "mass"),
    ({"parameters": {"b1": math.inf}}, "b1"),
    ({"parameters": {"mass": True}}, "mass"),
    ({"parameters": {"b0": math.inf}}, "b0"),
    # The delay.
    ({"delay": -1e-3}, "delay"),
    ({"delay": math.nan}, "delay"),
    ({"delay": 1e3}, "delay"),
    ({"delay": (0.0, 1e3)}, "delay"),
    ({"delay": (2e-3, 1e-3)}, "bounds of delay"),
    ({"delay": (1e-3, 1e-3)}, "bounds of delay"),
    ({"delay": "long"}, "delay"),
    ({"parameters": {"up": 0.0}}, "up"),
    # What is searched.
    ({"parameters": {"weight": pt.Parameter()}}, "parameters"),
    ({"parameters": {"up": pt.Parameter()}}, "parameters"),
    ({"parameters": dict.fromkeys(FORCES, pt.Parameter())}, "stiffness"),
    ({"parameters": asdict(TABLE_1)}, "parameters"),
    # The rest.
    ({"parameters": {"stiffness": 0.0}}, "stiffness"),
    ({"parameters": {"stiffness": -1.0}}, "stiffness"),
    ({"parameters": {"stiffness": math.nan}}, "stiffness"),
    ({"method": pt.LeastSquares()}, "method"),
    ({"method": [pt.Descents(), pt.ParticleSwarm()]}, "method"),
    ({"method": "simplex"}, "method"),
    ({"method": pt.Descents(runs=0)}, "runs"),
    ({"threads": "two"}, "threads"),
    ({"threads": -1}, "threads"),
]


# Of another type than asked for.
WRONG_TYPES: list[tuple[dict[str, Any], str]] = [
    ({"parameters": [("mass", (0.1, 0.2))]}, "parameters"),
    ({"parameters": {1: (0.1, 0.2)}}, "parameters"),
    ({"parameters": ["mass"]}, "parameters"),
    ({"parameters": "mass"}, "parameters"),
    ({"parameters": {"mass": True}}, "mass"),
    ({"parameters": {"mass": None}}, "mass"),
    ({"offset": "no"}, "offset"),
    ({"method": 5}, "method"),
    ({"method": pt.ParticleSwarm}, "method"),
    ({"callback": 5}, "callback"),
]
BAD = [*BAD_ARGUMENTS, *WRONG_TYPES]


def refused(arguments: dict[str, Any]) -> str:
    """The message with which arguments of `identify` are refused."""
    arguments = {"data": quick(), "model": "dahl", "method": SMALL, **arguments}
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
    assert refused({"parameters": {"mass": (0.2, 0.1)}}) == expected


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
    ("seed", -1),
    ("seed", 1.5),
    ("seed", "1"),
    ("runs", "2"),
]


@pytest.mark.parametrize(("name", "value"), BAD_SETTINGS)
def test_refuses_a_bad_setting_of_the_swarm(name: str, value: Any) -> None:
    with pytest.raises(pt.ParameterError, match=f"^{name} is .*: expected "):
        pt.ParticleSwarm(**{name: value})


@pytest.mark.parametrize(
    ("arguments", "argument"),
    [
        ({"parameters": {"mass": -1.0}}, "mass"),
        ({"parameters": {"weight": 1.0}}, "parameters"),
        ({"constraints": "a2 < b1"}, "constraints"),
        ({"method": 5}, "method"),
        ({"drift": -1.0}, "drift"),
        ({"delay": "long"}, "delay"),
        ({"threads": -1}, "threads"),
        ({"model": "unknown"}, "model"),
    ],
)
def test_an_error_has_the_name_of_its_argument(arguments: dict[str, Any], argument: str) -> None:
    with pytest.raises(pt.ParameterError) as caught:
        pt.identify(quick(), **{"model": "dahl", **arguments})
    assert caught.value.argument == argument
