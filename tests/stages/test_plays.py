"""The Prandtl-Ishlinskii stage: what play operators must do, and that a fit finds them."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

import piezotrack as pt
from play_records import PLAIN, STAGE, fit_plays, record

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

ZONES = list(zip(STAGE.dead_zone_thresholds, STAGE.dead_zone_weights, strict=True))
CREEPING = replace(STAGE, creep_weights=(0.004, 0.01), creep_times=(0.1, 1.0))


def wandering(samples: int = 20000, seed: int = 1) -> NDArray[np.float64]:
    """A path with large and small loops, from 0 to 75."""
    rng = np.random.default_rng(seed)
    turns = np.concatenate([[0.0], 75.0 * rng.random(200), 30.0 + 2.0 * rng.random(100)])
    places = np.linspace(0.0, turns.size - 1.0, samples)
    path: NDArray[np.float64] = np.interp(places, np.arange(turns.size), turns)
    return path


# The operator.


def test_it_is_the_sum_that_kuhnen_writes() -> None:
    u = wandering(2000)
    p = np.empty_like(u)
    z = np.zeros(4)
    r, w = np.array(STAGE.thresholds), np.array(STAGE.weights)
    for k, volts in enumerate(u):
        z = np.maximum(volts - r, np.minimum(volts + r, z))
        p[k] = STAGE.linear * volts + w @ z
    h = p + sum(s * np.maximum(p - d, 0.0) for d, s in ZONES)
    np.testing.assert_allclose(STAGE.simulate(u, 0.01).x, h, rtol=0.0, atol=1e-18)


def test_time_does_not_enter() -> None:
    u = wandering()
    fast, slow = STAGE.simulate(u, 1e-4).x, STAGE.simulate(u, 10.0).x
    np.testing.assert_array_equal(fast, slow)
    turns = np.array([0.0, 75.0, 10.0, 50.0, 30.0])
    finely = np.interp(np.linspace(0.0, 4.0, 4001), np.arange(5.0), turns)
    end = STAGE.simulate(finely, 1.0).x[-1]
    assert STAGE.simulate(turns, 1.0).x[-1] == pytest.approx(end, rel=1e-14)


def test_an_inner_loop_returns_to_where_it_left() -> None:
    x = STAGE.simulate([0.0, 60.0, 20.0, 40.0, 30.0, 40.0, 60.0], 1.0).x
    assert x[5] == pytest.approx(x[3], abs=1e-20)
    assert x[6] == pytest.approx(x[1], abs=1e-20)


def test_a_state_carries_on() -> None:
    u = wandering(3000)
    whole = CREEPING.simulate(u, 0.01)
    first = CREEPING.simulate(u[:1000], 0.01)
    second = CREEPING.simulate(u[999:], 0.01, initial=first.final)
    np.testing.assert_allclose(second.x, whole.x[999:], rtol=0.0, atol=1e-18)
    mode = replace(STAGE, frequency=20.0, damping_ratio=0.1)
    first = mode.simulate(u[:1000], 0.01)
    second = mode.simulate(u[999:], 0.01, initial=first.final)
    np.testing.assert_allclose(second.x, mode.simulate(u, 0.01).x[999:], rtol=0.0, atol=1e-18)


def test_a_held_drive_acts_one_sample_later() -> None:
    u = wandering(500)
    late, now = STAGE.simulate(u, 0.01, hold="zoh").x, STAGE.simulate(u, 0.01).x
    np.testing.assert_array_equal(late[1:], now[:-1])


# Creep and dynamics.


def test_creep_grows_with_the_logarithm_of_time() -> None:
    times = (0.1, 1.0, 10.0, 100.0)
    stage = pt.PrandtlIshlinskiiStage(
        linear=1e-6, thresholds=(), weights=(), creep_weights=(0.01,) * 4, creep_times=times
    )
    dt = 0.01
    x = stage.simulate(np.full(5001, 50.0), dt).x
    t = np.arange(5001) * dt
    expected = 50e-6 * (1.0 + sum(0.01 * (1.0 - np.exp(-t / tau)) for tau in times))
    np.testing.assert_allclose(x, expected, rtol=1e-12)
    decades = np.diff(x[[30, 300, 3000]]) / 50e-6
    assert decades == pytest.approx([0.01, 0.01], rel=0.12)


def test_a_step_through_the_dynamics_is_the_textbooks() -> None:
    t = np.arange(2001) * 1e-4
    bare = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(), weights=())
    lag = replace(bare, time_constant=5e-3).simulate(np.ones(2001), 1e-4).x
    np.testing.assert_allclose(lag, 1e-6 * (1.0 - np.exp(-t / 5e-3)), rtol=0.0, atol=1e-18)
    mode = replace(bare, frequency=160.0, damping_ratio=0.065).simulate(np.ones(2001), 1e-4).x
    wn, zeta = 2.0 * np.pi * 160.0, 0.065
    wd = wn * np.sqrt(1.0 - zeta**2)
    ringing = np.exp(-zeta * wn * t) * (np.cos(wd * t) + zeta * wn / wd * np.sin(wd * t))
    np.testing.assert_allclose(mode, 1e-6 * (1.0 - ringing), rtol=0.0, atol=1e-17)


# The inverse.


@pytest.mark.parametrize("stage", [PLAIN, STAGE], ids=["plays", "zones"])
def test_the_inverse_undoes_the_stage_along_any_path(stage: pt.PrandtlIshlinskiiStage) -> None:
    u = wandering()
    x = stage.simulate(u, 0.01).x
    none = np.zeros_like(x)
    back = stage.inverse()._begun(0.01).along(x, none, none)
    np.testing.assert_allclose(back, u, rtol=0.0, atol=1e-11)
    # And in metres, well below what is asked: 1e-12 m.
    np.testing.assert_allclose(stage.simulate(back, 0.01).x, x, rtol=0.0, atol=1e-17)


def test_the_inverse_undoes_creep_but_for_the_corners_between_samples() -> None:
    # It takes the hysteresis' output as straight from sample to sample.
    x = CREEPING.simulate(wandering(), 0.01).x
    none = np.zeros_like(x)
    back = CREEPING.inverse()._begun(0.01).along(x, none, none)
    np.testing.assert_allclose(CREEPING.simulate(back, 0.01).x, x, rtol=0.0, atol=2e-11)


def test_the_inverse_session_gives_what_the_whole_path_gives() -> None:
    reference = pt.sine(frequency=1.0, low=0.0, high=60e-6, duration=3.0)
    stage = replace(CREEPING, time_constant=2e-3)
    inverse = stage.inverse(playback="online")
    volts = inverse.voltage(reference, 1e-3)
    samples = reference.sample(1e-3)
    session = inverse.start(1e-3)
    for k in range(500):
        x, v, a = samples.x[k], samples.v[k], samples.a[k]
        assert session.step(x, velocity=v, acceleration=a) == volts[k]
    assert np.isnan(session.step(np.nan))
    session.reset()
    first = session.step(samples.x[0], velocity=samples.v[0], acceleration=samples.a[0])
    assert first == volts[0]


@pytest.mark.parametrize(
    "dynamics", [{"time_constant": 2e-3}, {"frequency": 160.0, "damping_ratio": 0.065}]
)
def test_dynamics_are_undone_with_the_derivatives(dynamics: dict[str, Any]) -> None:
    stage = replace(CREEPING, **dynamics)
    reference = pt.sine(frequency=1.0, low=0.0, high=60e-6, duration=3.0)
    volts = stage.inverse().voltage(reference, 1e-4)
    error = stage.simulate(volts, 1e-4).x - reference.sample(1e-4).x
    assert np.abs(error[5000:]).max() < 1e-9
    assert np.abs(STAGE.simulate(volts, 1e-4).x - reference.sample(1e-4).x).max() > 100e-9


def test_it_is_a_feedforward_for_a_controller() -> None:
    reference = pt.sine(frequency=1.0, low=0.0, high=50e-6, duration=4.0)
    virtual = pt.VirtualStage.xu_li_2010(seed=1)
    u = 37.5 * (1.0 - np.cos(2.0 * np.pi * np.arange(8000) * 1e-3))
    log = virtual.record(u, 1e-3)
    fit = fit_plays(log[1.0:8.0])
    worst = {}
    for name, inverse in {"inverse": fit.inverse(), "none": None}.items():
        pid = pt.Pid.from_um(kp=0.01, ti=0.009, td=0.0)
        loop = pt.Controller(dt=1e-3, limits=(0.0, 75.0), feedforward=inverse, feedback=pid)
        worst[name] = pt.track(virtual, loop, reference).metrics.rms_error
    assert worst["inverse"] < 0.5 * worst["none"]
    alone = pt.Controller(dt=1e-3, limits=(0.0, 75.0), feedforward=fit.inverse())
    # The mean is another matter: what the stage went through before, the inverse does not know.
    untold = pt.track(virtual, alone, reference).metrics
    assert untold.sd_error < 0.4e-6
    # Unless it is told.
    settled = fit.simulate(log[1.0:8.0], offset=fit.offset)
    knowing = replace(alone, feedforward=fit.inverse(initial=settled.final))
    told = pt.track(virtual, knowing, reference).metrics
    assert told.rms_error < 0.5 * untold.rms_error


def test_the_inverse_can_begin_on_a_settled_loop() -> None:
    u = wandering()
    before = CREEPING.simulate(u[:10000], 0.01)
    x = CREEPING.simulate(u[9999:], 0.01, initial=before.final).x
    none = np.zeros_like(x)
    inverse = CREEPING.inverse(initial=before.final)
    back = inverse._begun(0.01).along(x, none, none)
    # Corners between samples are 0.02 nm of creep.
    np.testing.assert_allclose(back, u[9999:], rtol=0.0, atol=2e-5)
    session, still = inverse.start(0.01), {"velocity": 0.0, "acceleration": 0.0}
    assert session.step(x[0], **still) == back[0]
    session.reset()
    assert session.step(x[0], **still) == back[0]
    expected = r"initial is int: expected a pt\.stages\.Prandtl.*State"
    with pytest.raises(pt.ParameterError, match=expected):
        CREEPING.inverse(initial=5)  # type: ignore[arg-type]
    with pytest.raises(pt.ShapeError, match="initial has 2 relaxations: expected 0"):
        PLAIN.inverse(initial=before.final)


# Files and words.


@cache
def fitted() -> pt.identification.Identification:
    stage = replace(CREEPING, time_constant=4e-3)
    return fit_plays(record(stage), drift=False, creep=(0.1, 1.0))


def test_the_settings_have_defaults() -> None:
    log = record(PLAIN, samples=1000)
    fit = pt.identify(log, model="prandtl-ishlinskii")
    assert fit.document() == fit_plays(log).document()
    assert (fit.success, fit.stop_reason) == (True, "solved")
    bare = pt.identify(log, model="prandtl-ishlinskii", offset=False)
    assert bare.offset == 0.0
    assert not bare.offset_fitted


REFUSED_BY_NAME: dict[str, Any] = {
    "parameters": {"linear": 1e-6},
    "constraints": ["linear < dilation"],
    "creep": True,
    "method": pt.ParticleSwarm(),
    "callback": print,
    "checkpoint": "file",
}


@pytest.mark.parametrize("name", REFUSED_BY_NAME)
def test_what_has_no_meaning_for_plays_is_refused(name: str) -> None:
    arguments: dict[str, Any] = {name: REFUSED_BY_NAME[name]}
    with pytest.raises(pt.ParameterError, match=f"^{name} is .*: expected .* with the model"):
        pt.identify(record(PLAIN, samples=1000), model="prandtl-ishlinskii", **arguments)


def test_how_a_search_is_run_may_be_said_of_plays_too() -> None:
    log = record(PLAIN, samples=1000)
    plain = pt.identify(log, "prandtl-ishlinskii")
    run = pt.identify(
        log,
        "prandtl-ishlinskii",
        method=[pt.Descents(seed=3, runs=2), pt.LeastSquares()],
        threads=1,
        progress=False,
    )
    assert run.model == plain.model


def test_the_number_of_values_fitted_counts_the_offset() -> None:
    # 1 + 4 weights: of 32 plays those about which the weights gather; 2 bends, 2 shares of the
    # creep, a time constant, an offset.
    assert fitted().free_count == 1 + 4 + 2 + 2 + 1 + 1


def test_a_file_gives_back_the_same_bits(tmp_path: Path) -> None:
    fit = fitted()
    loaded = pt.load(fit.save(tmp_path / "pi.json"))
    assert loaded.model == fit.model
    assert (loaded.offset, loaded.stroke, loaded.offset_fitted) == (fit.offset, fit.stroke, True)
    again = loaded.save(tmp_path / "again.json")
    assert again.read_bytes() == (tmp_path / "pi.json").read_bytes()
    document = json.loads(again.read_text())
    assert document["schema_version"] == 2
    assert document["parameters"]["weights"]["unit"] == "m/V"
    assert pickle.loads(pickle.dumps(loaded)) == loaded


BROKEN: dict[str, tuple[Any, str]] = {
    "unit": (lambda d: d["parameters"]["linear"].update(unit="um/V"), "the unit of linear"),
    "missing": (lambda d: d["parameters"].pop("weights"), "the entry 'weights' is missing"),
    "weight": (lambda d: d["parameters"]["weights"]["value"].pop(), "weights has 3 entries"),
    "form": (lambda d: d["parameters"]["weights"].update(value=5.0), "is not of the form"),
    "stroke": (lambda d: d["stroke"].update(value=0.0), "stroke is 0.0 m"),
    "model": (lambda d: d.update(model="dahl"), "the entry 'mass' is missing"),
    "no model": (
        lambda d: d.update(model="plays"),
        "holds a model 'plays': expected one of 'dahl'",
    ),
    "version": (lambda d: d.update(schema_version=3), "schema_version is 3: expected 1 to 2"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_refused(name: str, tmp_path: Path) -> None:
    breaks, words = BROKEN[name]
    document = fitted().document()
    document = json.loads(json.dumps(document))
    breaks(document)
    (tmp_path / "broken.json").write_text(json.dumps(document))
    with pytest.raises(pt.DataError, match=words):
        pt.load(tmp_path / "broken.json")


def test_the_summary_names_every_part() -> None:
    text = fitted().summary()
    for word in (
        "Prandtl-Ishlinskii",
        "% of stroke",
        "dead_zone_weights s",
        "creep_times",
        "time_constant",
    ):
        assert word in text
    assert "e-0" not in repr(fitted()).partition(":")[2].partition(" um")[0]


def test_the_picture_shows_the_record() -> None:
    figure = fitted().plot()
    assert len(figure.axes) == 3
    plt.close(figure)


# What makes a stage impossible, and the name that the message begins with.
STAGES: dict[str, tuple[dict[str, Any], str]] = {
    "linear": ({"linear": 0.0}, "linear"),
    "mixed": ({"linear": -1e-6}, "weights[0]"),
    "negative": ({"weights": (0.1, -0.2, 0.0, 0.0)}, "weights[1]"),
    "order": ({"thresholds": (3.0, 2.0, 5.0, 8.0)}, "thresholds[1]"),
    "length": ({"weights": (0.1,)}, "weights"),
    "zones": ({"dead_zone_weights": (-0.5, -0.6)}, "dead_zone_weights[1]"),
    "zones turned": ({"dead_zone_thresholds": (2e-6, 1e-6)}, "dead_zone_thresholds[1]"),
    "text": ({"weights": "abcd"}, "weights"),
    "creep": ({"creep_weights": (0.1,)}, "creep_weights"),
    "time": ({"time_constant": -1.0}, "time_constant"),
    "half": ({"frequency": 10.0}, "frequency and damping_ratio"),
    "both": ({"frequency": 10.0, "damping_ratio": 0.1, "time_constant": 1.0}, "time_constant"),
    "many": ({"thresholds": range(40), "weights": [0.0] * 40}, "weights"),
}


@pytest.mark.parametrize("name", STAGES)
def test_a_stage_that_cannot_be_is_refused(name: str) -> None:
    changes, begin = STAGES[name]
    with pytest.raises(pt.PiezotrackError) as caught:
        replace(STAGE, **changes)
    assert isinstance(caught.value, (pt.ParameterError, pt.ShapeError))
    assert str(caught.value).startswith((f"{begin} is ", f"{begin} has "))


def test_the_wording_of_a_refusal() -> None:
    with pytest.raises(pt.ParameterError) as caught:
        replace(STAGE, thresholds=(3.0, 2.0, 5.0, 8.0))
    assert str(caught.value) == "thresholds[1] is 2 V: expected 3 V or above: they ascend"


LOGS: dict[str, tuple[Any, Any, str]] = {
    "still": (lambda u: 0.0 * u, lambda y: y, "the drive is constant at 0 V"),
    "dead": (lambda u: u, lambda y: 0.0 * y, "sensor seems dead"),
    "one way": (np.sort, np.sort, "the drive never reverses"),
}


@pytest.mark.parametrize("name", LOGS)
def test_a_record_that_tells_nothing_is_refused(name: str) -> None:
    volts, metres, words = LOGS[name]
    log = record(PLAIN)
    with pytest.raises(pt.DataError, match=words):
        fit_plays(pt.Dataset(u=volts(log.u), y=metres(log.y), dt=1e-3))


ARGUMENTS: dict[str, tuple[dict[str, Any], str]] = {
    "count": ({"count": 0}, "count is"),
    "dead_zones": ({"dead_zones": 9}, "dead_zones is"),
    "dynamics": ({"dynamics": "third"}, "dynamics is"),
    "creep": ({"creep": [-1.0]}, "creep_times[0] is"),
    "thresholds": ({"thresholds": [2.0, 1.0]}, "thresholds[1] is"),
    "offset": ({"offset": 1}, "offset is"),
}


@pytest.mark.parametrize("name", ARGUMENTS)
def test_an_argument_that_cannot_be_is_refused(name: str) -> None:
    keywords, begin = ARGUMENTS[name]
    with pytest.raises(pt.ParameterError) as caught:
        fit_plays(record(PLAIN), **keywords)
    assert str(caught.value).startswith(begin)


def test_settings_of_another_kind_are_refused() -> None:
    with pytest.raises(pt.ParameterError, match=r"^method is 5: expected .* or pt\.LeastSquares"):
        pt.identify(record(PLAIN), "prandtl-ishlinskii", method=5)  # type: ignore[arg-type]


def test_a_short_window_is_refused() -> None:
    with pytest.raises(pt.DataError, match="twice the number of unknowns"):
        fit_plays(record(PLAIN)[1.0:1.01])
