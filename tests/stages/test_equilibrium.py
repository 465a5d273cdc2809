"""Equilibrium of a stage after slow visits to voltages."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import all_stages
import piezotrack as pt

DT = 0.01


@pytest.mark.parametrize("model", sorted(all_stages.STAGES))
def test_a_slow_drive_ends_there(model: str) -> None:
    stage: Any = all_stages.STAGES[model]
    visited = [30.0, 75.0, 40.0]
    if stage.info.drive_unit == "N":
        visited = [3.0, 7.5, 4.0]
    # Its creep would take hours to complete, and dry friction holds it anywhere near.
    changes: dict[str, Any] = {"b0": 0.0} if model == "dahl" else {}
    stage = replace(stage, creep_weights=(), creep_times=(), **changes)
    # Each leg ends with a velocity of 0, and rests.
    legs = [np.linspace(0.0, np.pi, 20001), np.full(4000, np.pi)]
    u, at = [], 0.0
    for goal in visited:
        u.append(at + (goal - at) * 0.5 * (1.0 - np.cos(np.concatenate(legs))))
        at = goal
    end = stage.simulate(np.concatenate(u), DT).final
    found = stage.equilibrium(visited)
    assert found.x == pytest.approx(end.x, abs=3e-5 * abs(stage.equilibrium(visited[1]).x))
    assert found.v == 0.0


def test_forces_are_in_balance() -> None:
    stage = pt.FirstOrderDahlStage(
        mass=0.18, damping=50.0, stiffness=2.6e4, piezo_coefficient=0.0468,
        rest_stiffness=1e4, coulomb_force=0.3,
    )  # fmt: skip
    state = stage.equilibrium([75.0, 20.0])
    drive = stage.piezo_coefficient * 20.0
    assert stage.stiffness * state.x + state.force == pytest.approx(drive, rel=1e-12)
    # On the way down the friction still holds the stage up.
    assert state.x > stage.equilibrium(20.0).x + 1e-6
    rest = stage.simulate([20.0] * 2000, 1e-3, initial=state)
    assert np.abs(rest.x - state.x).max() < 1e-15


def test_creep_is_complete() -> None:
    stage = pt.BoucWenStage.xu_li_2010_corrected()
    crept = pt.BoucWenStage(
        **{name: getattr(stage, name) for name in stage.parameter_names() if "creep" not in name},
        creep_weights=(0.02, 0.01),
        creep_times=(0.1, 10.0),
    )
    assert crept.equilibrium(50.0).x == pytest.approx(1.03 * stage.equilibrium(50.0).x, rel=1e-12)
    rest = crept.simulate([50.0] * 500, DT, initial=crept.equilibrium(50.0))
    assert np.abs(rest.x - rest.x[0]).max() < 1e-15


def test_a_voltage_that_is_none_is_refused() -> None:
    with pytest.raises(pt.DataError, match="voltages"):
        pt.DahlStage.xu_li_2010().equilibrium([float("nan")])


def test_a_closed_loop_begins_where_the_stage_was_left() -> None:
    stage = all_stages.STAGES["parallel-dahl"]
    loop = pt.Controller(dt=0.01, limits=(0.0, 75.0))
    still = pt.sine(frequency=1.0, low=0.0, high=20e-6, duration=1.0)
    timing = pt.Timing(voltages_before=(75.0, 30.0))
    begun = pt.track(stage, loop, still, timing=timing, beyond_reach=True)
    x = stage.equilibrium([75.0, 30.0]).x
    assert begun.displacement[0] == pytest.approx(x, rel=1e-12)
    assert pt.track(stage, loop, still, beyond_reach=True).displacement[0] == 0.0
    with pytest.raises(pt.ParameterError, match="has its preconditioning"):
        pt.track(pt.VirtualStage.xu_li_2010(), loop, still, timing=timing, beyond_reach=True)
