"""The list of models: what the core says of each is what its class has."""

from __future__ import annotations

import copy
import pickle
from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from all_stages import STAGES
from piezotrack.stages.registry import MODELS, model_named, model_of, stage_class

if TYPE_CHECKING:
    from piezotrack.stages.model_info import ModelInfo


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
    assert known["parallel-dahl"].hysteresis[-2:] == ("yield_path", "path_ratio")
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
