"""The list of models: what the core says of each is what its class has."""

from __future__ import annotations

import copy
import pickle
from dataclasses import fields, replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.stages.registry import MODELS, model_named, model_of, stage_class

if TYPE_CHECKING:
    from piezotrack.stages.base import ModelInfo

STAGES: dict[str, pt.stages.Stage] = {
    "dahl": replace(pt.DahlStage.xu_li_2010(), b0=40.0),
    "bouc-wen": pt.BoucWenStage.xu_li_2010_corrected(),
    "first-order-dahl": pt.FirstOrderDahlStage(
        mass=0.1828,
        damping=100.0,
        stiffness=26065.0,
        piezo_coefficient=0.0468,
        rest_stiffness=9e3,
        coulomb_force=0.15,
    ),
    "bouc-wen-oscillator": pt.BoucWenOscillator.benchmark(),
    "prandtl-ishlinskii": pt.PrandtlIshlinskiiStage(
        linear=1e-6,
        thresholds=(10.0, 20.0),
        weights=(0.2e-6, 0.1e-6),
        creep_weights=(0.01,),
        creep_times=(0.1,),
        frequency=160.0,
        damping_ratio=0.5,
    ),
    "generalised-prandtl-ishlinskii": pt.GeneralisedPrandtlIshlinskiiStage(
        linear=1e-6,
        thresholds=(10.0, 20.0),
        weights=(0.2e-6, 0.1e-6),
        scale=100.0,
        slope=0.01,
        shift=0.2,
        level=-10.0,
        time_constant=0.002,
    ),
}


@pytest.mark.parametrize("info", MODELS, ids=[info.name for info in MODELS])
def test_a_class_has_the_parameters_and_the_state_of_the_core(info: ModelInfo) -> None:
    cls = stage_class(info)
    assert cls.info is model_named(info.name) is info
    names = [one.name for one in fields(cls)]  # type: ignore[arg-type]
    assert names == [one.name for one in info.parameters]
    assert list(cls.parameter_names()) == names
    state = {one.name for one in fields(cls._state)}
    assert state == {one.name for one in info.state}


@pytest.mark.parametrize("name", STAGES)
def test_a_stage_can_be_copied_and_pickled(name: str) -> None:
    stage = STAGES[name]
    assert model_of(stage).name == name
    u = 20.0 * np.sin(np.arange(200) / 20.0)
    x = stage.simulate(u, 1e-3).x
    for other in (pickle.loads(pickle.dumps(stage)), copy.deepcopy(stage)):
        assert other == stage
        assert hash(other) == hash(stage)
        assert other.simulate(u, 1e-3).x.tobytes() == x.tobytes()


@pytest.mark.parametrize("name", STAGES)
def test_the_state_of_another_model_is_refused(name: str) -> None:
    stage = STAGES[name]
    final = STAGES["dahl" if name != "dahl" else "bouc-wen"].simulate([0.0, 1.0], 0.01).final
    expected = r"^initial is \w+State: expected a pt\.stages\.\w+State"
    with pytest.raises(pt.ParameterError, match=expected):
        stage.simulate([0.0, 1.0], 0.01, initial=final)
    expected = r"^initial is \w+State: expected a pt\.stages\.\w+State"
    with pytest.raises(pt.ParameterError, match=expected):
        stage.inverse(initial=final)


def test_hysteresis_and_forces_follow_from_the_core() -> None:
    known = {info.name: info for info in MODELS}
    assert known["dahl"].hysteresis == ("a1", "a2", "b1")
    assert known["bouc-wen"].hysteresis == ("alpha", "beta", "gamma")
    assert known["first-order-dahl"].hysteresis == ("rest_stiffness", "coulomb_force")
    assert known["prandtl-ishlinskii"].hysteresis == ()
    assert known["dahl"].force_symbols == "M, D, T, b1 and b0"
    assert known["bouc-wen"].force_symbols == "m and b"


@pytest.mark.parametrize("other", STAGES)
def test_an_xy_stage_takes_any_two_stages(other: str) -> None:
    x, y = STAGES["prandtl-ishlinskii"], STAGES[other]
    dt = 2e-4
    u = 30.0 * np.sin(np.arange(500) / 40.0)
    along_x, along_y = pt.XYStage(x=x, y=y, cross_talk=(0.1, 0.2)).simulate(u, -u, dt)
    alone_x, alone_y = x.simulate(u, dt).x, y.simulate(-u, dt).x
    reach = np.ptp(alone_x) + np.ptp(alone_y)
    assert np.abs(along_x.x - alone_x - 0.1 * alone_y).max() < 1e-3 * reach
    assert np.abs(along_y.x - alone_y - 0.2 * alone_x).max() < 1e-3 * reach
