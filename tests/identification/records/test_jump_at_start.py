"""Records whose drive jumps to the first sample, and starts of other records."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.identification.fitted.notes import start_notes
from piezotrack.identification.fitted.start import Start
from piezotrack.identification.problem.problem import Problem
from piezotrack.identification.problem.records import Record
from piezotrack.identification.solve.one_model import identify_model
from piezotrack.identification.solve.run import Run
from piezotrack.identification.solve.weights import Structure

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from piezotrack.data.dataset import Hold

DT, NOISE = 1e-3, 20e-9
STAGE = pt.PrandtlIshlinskiiStage(
    linear=8e-7,
    thresholds=(5.0, 10.0, 20.0, 30.0),
    weights=(1e-7, 8e-8, 6e-8, 4e-8),
    frequency=120.0,
    damping_ratio=0.05,
)
T = DT * np.arange(4000)


def jumping(hold: Hold = "foh", before: float = 0.0) -> pt.Dataset:
    """A triangle from 20 V, to which the stage came from rest within one interval."""
    u = 20.0 + 110.0 * np.abs((T + 0.5) % 1.0 - 0.5)
    rest = STAGE.equilibrium(before)
    x = STAGE.simulate(np.concatenate(([before], u)), DT, hold=hold, initial=rest).x[1:]
    return pt.Dataset(
        u=u, y=x + NOISE * np.random.default_rng(0).normal(size=u.size), dt=DT, hold=hold
    )


def other_motion() -> pt.Dataset:
    u = 37.5 * (1.0 - np.cos(6.0 * np.pi * T))
    return pt.Dataset(u=u, y=STAGE.simulate(u, DT).x, dt=DT)


@pytest.mark.parametrize("hold", ["foh", "zoh"])
def test_a_stage_at_rest_before_the_drive_jumped_is_known(hold: Hold, tmp_path: Path) -> None:
    log = jumping(hold)
    fit = pt.identify(log, "prandtl-ishlinskii", progress=False)
    assert fit.start is not None
    assert fit.start.history == "rest"
    assert fit.cost < 1.2 * NOISE
    assert fit.score(other_motion(), history="virgin").rms < 3.0 * NOISE
    # The jump lies at the first sample, which is not judged.
    assert len(fit.data) == len(log) - 1
    fit.save(tmp_path / "model.json")
    again = pt.load(tmp_path / "model.json")
    assert again.score(fit.data).rms == pytest.approx(fit.cost, rel=1e-6)
    named = pt.identify(log, "prandtl-ishlinskii", history="rest", progress=False)
    assert named.cost == pytest.approx(fit.cost, rel=1e-6)


def test_a_jump_is_found_in_a_long_record_of_noise() -> None:
    """Its error, of few samples, is above the noise of all of them."""
    u = np.repeat(np.random.default_rng(2).uniform(20.0, 100.0, 40), 300)
    x = STAGE.simulate(np.concatenate(([0.0], u)), DT, hold="zoh").x[1:]
    noise = 1.2e-6
    y = x + noise * np.random.default_rng(0).normal(size=u.size)
    fit = pt.identify(pt.Dataset(u=u, y=y, dt=DT, hold="zoh"), "prandtl-ishlinskii", progress=False)
    assert fit.start is not None
    assert fit.start.history == "rest"
    assert fit.cost < 1.01 * noise


def test_a_jump_is_tried_beside_a_model_that_has_one() -> None:
    """Without a jump, any model is worse than another that has it."""
    log, method = jumping(), pt.LeastSquares()
    (jumped, still) = (
        pt.identify(log, "prandtl-ishlinskii", history=history, progress=False)
        for history in (None, "virgin")
    )
    problem = Problem(model="polynomial-prandtl-ishlinskii", records=(Record(log, delay=False),))
    run = Run(progress=False)
    assert jumped.cost < 0.1 * still.cost
    fit = identify_model(problem, method, run, Structure.of(jumped))
    assert fit.start is not None
    assert fit.start.history == "rest"
    assert fit.cost < 1.2 * NOISE


def test_the_voltage_of_rest_is_found() -> None:
    fit = pt.identify(jumping(before=90.0), "prandtl-ishlinskii", progress=False)
    assert fit.start is not None
    assert fit.start.history == "rest"
    assert fit.start.voltage == pytest.approx(90.0, abs=2.0)
    assert fit.cost < 1.1 * NOISE


def test_the_voltage_of_rest_is_found_where_the_drive_reverses_late() -> None:
    # Its first reversal is the 2001st sample; it comes from rest in the middle of its range.
    u = 50.0 * np.cos(np.pi * T / T[2000])
    x = STAGE.simulate(np.concatenate(([12.0], u)), DT, initial=STAGE.equilibrium(12.0)).x[1:]
    log = pt.Dataset(u=u, y=x + NOISE * np.random.default_rng(0).normal(size=u.size), dt=DT)
    fit = pt.identify(log, "prandtl-ishlinskii")
    assert fit.start is not None
    assert fit.start.voltage == pytest.approx(12.0, abs=2.0)
    assert fit.cost < 1.2 * NOISE


def test_a_play_that_a_jump_alone_moves_has_no_weight_of_rounding_errors() -> None:
    # From the middle of its range the drive reaches half of it, but for rounding, in each period.
    u = 50.0 * np.cos(np.pi * T / 0.9973)
    rest, late = -3.0, 0.4e-3
    still = STAGE.equilibrium(rest)
    x = STAGE.simulate(u, DT, initial=still).x
    y = np.interp(T - late, T, x, left=still.x) + NOISE * np.random.default_rng(0).normal(
        size=u.size
    )
    log = pt.Dataset(u=u, y=y, dt=DT)
    fit = pt.identify(log[:2.5], "prandtl-ishlinskii")
    assert fit.delay == pytest.approx(late, abs=0.05e-3)
    assert max(fit.model.weights) < 2e-7
    later = log[2.5:]
    assert np.std(later.y - fit.simulate(later, offset=fit.offset).x) < 1.2 * NOISE


def test_the_voltage_of_rest_is_found_beside_a_drift() -> None:
    """Between the voltages that are tried first, where the weights stand for what is missed."""
    log = jumping(before=40.0)
    drifting = pt.Dataset(u=log.u, y=log.y + 0.5e-6 * np.exp(-T / 1.5), dt=DT)
    fit = pt.identify(drifting, "prandtl-ishlinskii", drift=True, progress=False)
    assert fit.start is not None
    assert fit.start.voltage == pytest.approx(40.0, abs=1.0)
    assert fit.cost < 1.1 * NOISE
    assert fit.score(other_motion(), history="virgin").rms < 8.0 * NOISE


@pytest.mark.parametrize(("first", "told"), [(0.0018, False), (0.5, False), (20.0, True)])
def test_a_small_step_to_the_first_sample_is_no_jump(first: float, told: bool) -> None:
    u = first + 37.5 * (1.0 - np.cos(6.0 * np.pi * T))
    start = Start(history="rest", state=STAGE.equilibrium(0.0), voltage=0.0, record="")
    note = start_notes(start, pt.Dataset(u=u, y=1e-6 * u, dt=DT))
    assert note is not None
    assert "0 V" in note
    assert (f"{first:g} V" in note) == told


def test_a_searched_model_begins_at_rest_too() -> None:
    stage = pt.FirstOrderDahlStage(
        mass=0.1828,
        damping=100.0,
        stiffness=26065.0,
        piezo_coefficient=0.0468,
        rest_stiffness=9e3,
        coulomb_force=0.15,
    )
    u = 30.0 + 25.0 * np.sin(2.0 * np.pi * T)
    x = stage.simulate(np.concatenate(([0.0], u)), DT).x[1:]
    log = pt.Dataset(u=u, y=x, dt=DT)
    fit = pt.identify(log, "first-order-dahl", progress=False)
    assert fit.start is not None
    assert fit.start.history == "rest"
    virgin = pt.identify(log, "first-order-dahl", history="virgin", progress=False)
    assert fit.cost < 0.5 * virgin.cost


def test_a_jump_is_of_one_record() -> None:
    with pytest.raises(pt.ParameterError) as error:
        pt.identify([jumping(), other_motion()], "prandtl-ishlinskii", history="rest")
    assert error.value.argument == "history"


def test_a_record_that_neither_simple_history_explains_begins_with_a_fitted_one() -> None:
    stage = pt.PrandtlIshlinskiiStage(
        linear=8e-7, thresholds=(2.0, 5.0, 10.0, 20.0), weights=(1e-7, 1e-7, 8e-8, 6e-8)
    )
    rng, t = np.random.default_rng(3), 2e-3 * np.arange(3000)

    def record(u: NDArray[np.float64], before: list[float]) -> pt.Dataset:
        x = stage.simulate(u, 2e-3, initial=stage.equilibrium([*before, float(u[0])])).x
        return pt.Dataset(u=u, y=x + 1e-8 * rng.normal(size=u.size), dt=2e-3)

    large = record(37.5 * (1.0 - np.cos(2.0 * np.pi * t) * (1.0 - t / 8.0)), [])
    fit = pt.identify(large, "prandtl-ishlinskii", progress=False)
    # A virgin and a settled stage move alike in this small loop, and both differ from one that
    # came from 75 V, far beyond the drive of the record.
    small = record(40.0 + 6.0 * np.sin(2.0 * np.pi * t + 1.2), [75.0])
    assert fit.score(small, history="virgin").rms > 20.0 * fit.cost
    assert fit.score(small).rms < 3.0 * fit.cost


# Of a jump a tenth before the sample a part of the noise's size is left, which moves the damping.
@pytest.mark.parametrize(
    ("tenths", "within", "off"), [(0, False, 0.05), (1, False, 0.1), (5, True, 0.05)]
)
def test_the_time_of_a_jump_to_the_first_sample_is_found(
    tenths: int, within: bool, off: float
) -> None:
    # The drive jumps at once, so many tenths of an interval before the first sample.
    fine = 10
    t = DT / fine * np.arange(fine * (T.size - 1) + 1 + tenths)
    u = 20.0 + 110.0 * np.abs((t - tenths * DT / fine + 0.5) % 1.0 - 0.5)
    x = STAGE.simulate(u, DT / fine, initial=STAGE.equilibrium(0.0)).x[tenths::fine]
    noise = NOISE * np.random.default_rng(0).normal(size=T.size)
    log = pt.Dataset(u=u[tenths::fine], y=x + noise, dt=DT)
    fit = pt.identify(log, "prandtl-ishlinskii", progress=False)
    assert fit.start is not None
    assert fit.start.history == "rest"
    assert fit.start.within == within
    assert fit.cost < 2.0 * NOISE
    assert fit.model.frequency == pytest.approx(120.0, rel=0.01)
    assert fit.model.damping_ratio == pytest.approx(0.05, rel=off)
