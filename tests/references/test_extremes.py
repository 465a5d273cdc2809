"""References of extreme numbers, and motions of one's own that return none."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Callable

HUGE = 10**400
RANGE: dict[str, Any] = {"low": 0.0, "high": 1e-4}
LOG = pt.Dataset(u=np.arange(500.0), y=np.arange(500.0) * 1e-6, dt=0.001)


def moving(motion: Callable[[Any], Any]) -> pt.Reference:
    return pt.Reference(name="mine", duration=1.0, low=0.0, high=1e-5, motion=motion)


NOT_FINITE: dict[str, tuple[Callable[[], pt.Reference], str]] = {
    "ramp": (lambda: pt.sine(frequency=1.0, duration=1.0, ramp=1e-301, **RANGE), "sine 1 Hz"),
    "rise": (lambda: pt.staircase(steps=2, dwell=1.0, rise=1e-301, **RANGE), "staircase"),
    "steep": (lambda: pt.staircase(steps=2, dwell=1.0, rise=1e-200, **RANGE), "staircase"),
    "nan": (
        lambda: moving(lambda t: (np.where(t > 0.55, np.nan, t), t, t)),
        "mine is nan m, .* at 0.6",
    ),
    "infinite": (lambda: moving(lambda t: (t, t, t / (t - 0.5))), "mine is 0.5 m, .* at 0.5"),
}


@pytest.mark.parametrize("frequency", [1e-300, 1e-10, 1e13, 1.7e308])
def test_a_frequency_of_no_motion_is_refused(frequency: float) -> None:
    for name, make in (
        ("frequency", lambda: pt.sine(frequency=frequency, duration=1.0, **RANGE)),
        (
            "stop_frequency",
            lambda: pt.chirp(start_frequency=1.0, stop_frequency=frequency, duration=1.0, **RANGE),
        ),
        ("frequencies", lambda: pt.multisine(frequencies=[1.0, frequency], duration=1.0, **RANGE)),
        ("line_rate", lambda: pt.raster(line_rate=frequency, sizes=(2e-5, 2e-5), lines=9)),
    ):
        with pytest.raises(pt.ParameterError, match=rf"^{name} is .* Hz: expected 1e-09 to 1e\+12"):
            make()


@pytest.mark.parametrize("name", NOT_FINITE)
def test_a_motion_that_is_not_finite_is_refused_with_its_time(name: str) -> None:
    make, called = NOT_FINITE[name]
    reference = make()
    step = min(0.1, 0.4 * reference.shortest) if reference.shortest > 1e-3 else 0.1
    times = np.arange(0.0, reference.duration, step)
    with pytest.raises(pt.ParameterError, match=rf"^motion of {called}.* s: expected finite"):
        reference.at(times)


def test_the_path_of_such_a_motion_is_refused_too() -> None:
    bad = moving(lambda t: (np.where(t > 0.5, np.nan, t), t, np.where(t > 0.5, np.nan, t)))
    path = pt.XYReference(name="path", x=moving(lambda t: (t, t, t)), y=bad)
    with pytest.raises(pt.ParameterError, match=r"^motion of mine is nan m"):
        path.errors([0.0], [0.0])


@pytest.mark.parametrize(
    "motion",
    [
        lambda _: None,
        lambda t: (t, t),
        lambda t: (t, t, 1.0),
        lambda t: (t, t, t[:-1]),
        lambda t: (t, t, ["x"] * t.size),
        lambda _: 5.0,
    ],
)
def test_a_motion_must_return_three_arrays(motion: Callable[[Any], Any]) -> None:
    with pytest.raises(
        pt.ParameterError, match=r"^motion of mine returns .*: expected displacement"
    ):
        moving(motion).sample(0.1)


def test_a_simulation_of_such_a_motion_is_refused_too() -> None:
    loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
    reference = moving(lambda t: (np.where(t > 0.5, np.nan, 1e-5 * t), 1e-5 * t, t))
    with pytest.raises(pt.ParameterError, match=r"^motion of mine is nan m"):
        pt.track(pt.DahlStage.xu_li_2010(), loop, reference)


TOO_LARGE: dict[str, tuple[Callable[[], Any], str]] = {
    "multisine": (
        lambda: pt.multisine(frequencies=[1e-3, 1e5], duration=1e5, **RANGE),
        "the motion has 1e[+]08 of its shortest periods",
    ),
    "lissajous": (
        lambda: pt.lissajous(frequencies=(1e-3, 1e5), sizes=(1e-5, 1e-5)),
        "the motion has 1e[+]08 of its shortest periods",
    ),
    "interpolate": (lambda: LOG.interpolate(10**8), "factor is 100000000: expected at most 100200"),
    "interpolate, huge": (lambda: LOG.interpolate(HUGE), "factor is 10+\\.\\.\\.: expected"),
    "decimate, huge": (
        lambda: LOG.decimate(HUGE),
        "factor is 10+\\.\\.\\.: expected one that leaves",
    ),
    "window": (lambda: LOG[0.0:HUGE], "stop is 10+\\.\\.\\.: expected a finite number"),
    "dt": (lambda: pt.Dataset(u=LOG.u, y=LOG.y, dt=1e-300), "dt is 1e-300 s: expected 1e-12"),
    "dt of a simulation": (
        lambda: pt.DahlStage.xu_li_2010().simulate(LOG.u, 1e-300),
        "dt is 1e-300 s: expected 1e-12",
    ),
    "frequency": (
        lambda: pt.sine(frequency=HUGE, duration=1.0, **RANGE),
        "frequency is 10+\\.\\.\\.: expected a number that float64 can hold",
    ),
    "many digits": (
        lambda: pt.sine(frequency=10**5000, duration=1.0, **RANGE),
        "frequency is too long to print: expected a number that float64 can hold",
    ),
    "levels": (lambda: pt.staircase(levels=[0.0, HUGE], dwell=1.0), "levels is 10+"),
    "endless levels": (
        lambda: pt.staircase(levels=np.broadcast_to(1e-6, (10**9,)), dwell=1.0),
        "levels has more entries: expected 1000000 at most",
    ),
    "duration of a spiral": (
        lambda: pt.references.parse_path("spiral:0.5Hz,20um,pitch=2um", duration=""),  # type: ignore[arg-type]
        "duration is '': expected none",
    ),
    "duration of a circle": (
        lambda: pt.references.parse_path("circle:0.5Hz,20um", duration=HUGE),
        "path 'circle:0.5Hz,20um': duration is 10+",
    ),
    "cross-talk": (
        lambda: pt.XYStage(
            x=pt.VirtualStage.xu_li_2010(),
            y=pt.VirtualStage.xu_li_2010(),
            cross_talk=[[1.0, 2.0], [3.0]],  # type: ignore[arg-type]
        ),
        "cross_talk is \\[\\[1.0, 2.0\\], \\[3.0\\]\\]: expected two numbers",
    ),
    "state space": (lambda: pt.control.StateSpace([[HUGE]], [1.0], [1.0]), "a is \\[\\[10+"),
    "inverse": (
        lambda: pt.DahlStage.xu_li_2010().inverse().start(0.02).step(HUGE),
        "reference is 10+",
    ),
    "complex": (
        lambda: pt.sine(frequency=np.complex64(1 + 1j), duration=1.0, **RANGE),  # type: ignore[arg-type]
        "frequency is .*1.*j.*: expected a number",
    ),
    "delay": (
        lambda: pt.track(
            pt.DahlStage.xu_li_2010(),
            pt.Controller(dt=0.02, limits=(0.0, 75.0)),
            pt.sine(frequency=1.0, duration=1.0, low=0.0, high=1e-5),
            timing=pt.Timing(delay=1e300),
            unstable=True,
        ),
        "delay is 1e300 s: expected",
    ),
}


@pytest.mark.parametrize("name", TOO_LARGE)
def test_numbers_beyond_any_use_are_refused_in_words(name: str) -> None:
    call, message = TOO_LARGE[name]
    with pytest.raises(pt.ParameterError, match=f"^{message}") as caught:
        call()
    assert len(str(caught.value)) < 400


@pytest.mark.parametrize("stage", [pt.DahlStage.xu_li_2010(), pt.BoucWenOscillator.benchmark()])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_state_that_is_not_finite_is_refused_whatever_the_drive(stage: Any, value: float) -> None:
    from dataclasses import replace

    state = replace(stage.simulate([0.0, 1.0], 0.001).final, v=value)
    with pytest.raises(pt.ParameterError, match=r"^v of initial is .*: expected a finite number"):
        stage.simulate([1.0], 0.001, initial=state)


@pytest.mark.parametrize(
    "text", ["sine:" + "1" * 9_000 + "!", "sine:" + "9" * 10**6, "sine:1" + " " * 9_900 + "!"]
)
def test_a_long_text_is_refused_in_linear_time_and_few_words(text: str) -> None:
    began = time.monotonic()
    with pytest.raises(pt.ParameterError) as caught:
        pt.parse_reference(text)
    assert len(str(caught.value)) < 700
    assert time.monotonic() - began < 5.0


def test_the_range_of_a_long_motion_is_found_as_before() -> None:
    """A raster of many lines is the longest motion whose range is sought."""
    scan = pt.raster(line_rate=1.0, sizes=(2e-5, 2e-5), lines=200)
    assert scan.x.low == pytest.approx(48.06e-6, abs=0.01e-6)
