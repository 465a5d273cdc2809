"""Linear systems of python-control beside the loop that is simulated."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import Any

import control
import numpy as np
import pytest

import piezotrack as pt
from loops import loop, sine

# Without plays what is linearised is the stage itself.
MODE = pt.PrandtlIshlinskiiStage(
    linear=1.5e-6, thresholds=(), weights=(), frequency=40.0, damping_ratio=0.2
)
PID = pt.Pid.from_um(kp=0.05, ti=0.05, td=0.002)
DT = 0.004


@pytest.mark.parametrize("delay", [0.0, 0.0015, 0.004, 0.0093])
@pytest.mark.parametrize("dynamics", ["mode", "none"])
def test_the_loop_of_both_systems_is_the_one_simulated(delay: float, dynamics: str) -> None:
    model = MODE if dynamics == "mode" else replace(MODE, frequency=None, damping_ratio=None)
    bandwidth = 200.0 if dynamics == "mode" else np.inf
    stage = pt.VirtualStage.of(model, delay=delay, bandwidth=bandwidth)
    law = replace(PID, kp=0.5 * PID.kp) if dynamics == "none" else PID
    # From 0 on: the feedback simulated sees no jump at its first sample.
    run = pt.track(stage, loop(dt=DT, limits=(-90.0, 90.0), feedback=law), sine(0.5, 4.0))
    plant = pt.to_control(stage, limits=(0.0, 75.0), dt=DT)
    whole = control.feedback(pt.to_control(law, dt=DT) * plant, 1)
    found = np.asarray(control.forced_response(whole, U=run.desired).outputs)
    # The amplifier is simulated in steps.
    assert np.abs(found - run.measured).max() < 1e-10


def test_gains_are_those_of_the_check() -> None:
    stage = pt.VirtualStage.xu_li_2010()
    report = pt.check_loop(stage, loop(feedback=pt.Pid.xu_li_2010()))
    for gain in ("low", "middle", "high"):
        plant = pt.to_control(stage, limits=(0.0, 75.0), gain=gain)
        assert plant.dcgain().real == pytest.approx(getattr(report, gain).gain)
    # 225 Hz of the amplifier and 160 Hz of the mode.
    poles = np.abs(plant.poles()) / (2 * np.pi)
    assert sorted(poles) == pytest.approx([160.0, 160.0, 225.0])


def test_an_identified_model_knows_its_range_and_its_delay() -> None:
    fit = pt.identify(pt.datasets.dbo_training()[3.0:23.0], "prandtl-ishlinskii")
    plant = pt.to_control(replace(fit, delay=0.01), dt=0.005)
    assert "0 to 3600 mV" in plant.name
    late = control.step_response(plant, T=0.005 * np.arange(6)).outputs
    assert np.abs(late[:3]).max() == 0.0
    assert late[3] > 0.0


def test_matrices_of_python_control_are_a_feedback_law() -> None:
    system = control.ss(pt.to_control(PID, dt=DT))
    law = pt.control.StateSpace(system.A, system.B, system.C, system.D)
    back = pt.to_control(law, dt=DT)
    f = np.geomspace(1.0, 700.0, 20)
    assert np.allclose(system(np.exp(1j * f * DT)), back(np.exp(1j * f * DT)))
    of_loop = pt.to_control(loop(dt=DT, feedback=law))
    assert of_loop.dt == DT


@pytest.mark.parametrize(
    ("part", "options", "message"),
    [
        (3, {}, "part is 3: expected a stage or a controller"),
        (MODE, {}, r"limits are missing: expected \(low, high\) in V"),
        (MODE, {"limits": (1.0, 0.0)}, "expected the lower one first"),
        (MODE, {"limits": (0.0, 1.0), "gain": "mean"}, "gain is 'mean': expected 'low'"),
        (
            MODE,
            {"limits": (0.0, 1.0), "delay": 0.1},
            "dt is missing: expected a sampling interval, as the stage has a delay of 0.1",
        ),
        (MODE, {"limits": (0.0, 1.0), "dt": 0.0}, "dt is 0"),
        (PID, {}, "dt is missing: expected the sampling interval"),
        (PID, {"dt": 0.1, "limits": (0.0, 1.0)}, "have no effect on a feedback law"),
        (loop(), {}, "part is a controller without feedback"),
        (loop(dt=DT, feedback=PID), {"dt": 0.1}, "the controller has its own"),
    ],
)
def test_what_has_no_linear_system_is_refused(
    part: Any, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(pt.ParameterError, match=message):
        pt.to_control(part, **options)


def test_without_python_control_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(pt.ParameterError, match="to_control needs python-control"):
        pt.to_control(PID, dt=0.1)


# A controller and a stage of an identified model.


def test_a_controller_of_a_model_has_its_range_and_its_interval() -> None:
    fit = pt.identify(pt.datasets.dbo_training()[3.0:23.0], "prandtl-ishlinskii")
    controller = pt.Controller.of(fit, feedback=PID)
    assert (controller.dt, controller.limits) == (0.005, fit.drive_range)
    assert controller.feedback is PID
    assert controller.feedforward is not None
    assert controller.feedforward.offset == fit.offset
    other = pt.Controller.of(fit, dt=0.01, limits=(0.0, 2.0))
    assert (other.dt, other.limits) == (0.01, (0.0, 2.0))
    bare = replace(fit, details={})
    with pytest.raises(pt.ParameterError, match=r"dt is not in the file of this model"):
        pt.Controller.of(bare)
    with pytest.raises(pt.ParameterError, match=r"^model is .*: expected what"):
        pt.Controller.of(pt.VirtualStage.of(fit))  # type: ignore[arg-type]


def test_readings_far_from_0_are_those_of_the_stage() -> None:
    """The span of valid readings has the offset of the sensor in it."""
    model = pt.identification.IdentifiedModel(
        model=replace(MODE, frequency=None, damping_ratio=None),
        offset=-125e-6,
        offset_fitted=True,
        stroke=100e-6,
    )
    reference = pt.sine(frequency=0.5, low=-120e-6, high=-60e-6, duration=4.0)
    feedback = pt.Pid.from_um(kp=0.2, ti=0.01)
    one = pt.Controller(dt=DT, limits=(0.0, 75.0), feedback=feedback)
    assert pt.track(model, one, reference).metrics.max_error < 5e-6
    exact = pt.Controller.of(model, dt=DT, limits=(0.0, 75.0), feedback=feedback)
    run = pt.track(pt.VirtualStage.of(model, noise=5e-9), exact, reference)
    assert run.feedback.any()
    assert run.metrics.rms_error < 0.3e-6


def test_a_stage_that_never_sees_0_volts_begins_at_its_nearest_limit() -> None:
    stage = replace(MODE, frequency=None, damping_ratio=None)
    reference = pt.sine(frequency=0.5, low=35e-6, high=70e-6, duration=4.0)
    run = pt.track(stage, loop(limits=(20.0, 60.0)), reference)
    assert run.measured[0] == pytest.approx(30e-6)
    low = pt.track(stage, loop(limits=(-60.0, -20.0)), pt.sine(
        frequency=0.5, low=-70e-6, high=-35e-6, duration=4.0))  # fmt: skip
    assert low.measured[0] == pytest.approx(-30e-6)
    both = pt.XYStage(x=stage, y=stage)
    space = pt.control.workspace(both, (20.0, 60.0))
    assert space.x == pytest.approx((30e-6, 90e-6))
    assert space.centre == pytest.approx((60e-6, 60e-6))
    assert space.rest == pytest.approx((30e-6, 30e-6))
    path = pt.circle(frequency=0.5, radius=5e-6, centre=space.centre, origin=space.rest)
    one = loop(limits=(20.0, 60.0))
    run_of_both = pt.contour(both, (one, one), path)
    assert run_of_both.y.measured[0] == pytest.approx(30e-6)
