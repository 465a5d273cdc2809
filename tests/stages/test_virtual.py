"""The virtual stage beside what is published of the real one, and what it refuses."""

from __future__ import annotations

import dataclasses
import math
import pickle
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from records import BOX, HELD
from virtual import changed

STAGE = pt.VirtualStage.xu_li_2010(seed=1)
FAST = 1 / 5000.0
FIELDS = [one.name for one in dataclasses.fields(STAGE)]


def quiet(**other: Any) -> pt.VirtualStage:
    changes: dict[str, Any] = {"noise": 0.0, "resolution": 0.0, **other}
    return changed(STAGE, **changes)


def test_it_is_a_record_of_plain_numbers() -> None:
    again = pt.VirtualStage(**{name: getattr(STAGE, name) for name in FIELDS})
    assert again == STAGE
    assert hash(again) == hash(STAGE)
    assert dataclasses.replace(STAGE) == STAGE
    assert pickle.loads(pickle.dumps(STAGE)) == STAGE
    other = quiet(resolution=STAGE.sensor.resolution, weights=list(STAGE.stage.weights))
    assert other != STAGE
    assert changed(other, noise=STAGE.sensor.noise) == STAGE
    # Whole numbers are numbers too.
    whole = quiet(limits=[0, 75], frequency=160)
    assert whole == quiet()
    assert isinstance(whole.stage.frequency, float)


def test_what_is_published_of_it() -> None:
    assert STAGE.amplifier.limits == (0.0, 75.0)
    assert STAGE.stage.frequency == 160.0
    assert STAGE.stage.damping_ratio == 0.065
    # 2.5 mm in 16 bit.
    assert STAGE.sensor.resolution == pytest.approx(0.038e-6, rel=0.005)
    assert STAGE.sensor.range == pytest.approx(1.25e-3)


def test_the_step_is_near_the_published_one() -> None:
    """Fig. 4: ends at 117.76 um, overshoots to 192.53 um, rings with 160 to 172 Hz."""
    run = STAGE.simulate(np.full(1500, 75.0), FAST, hold="zoh")
    x = 1e6 * run.x
    assert x[-1] == pytest.approx(117.7622, rel=0.005)
    peaks = [k for k in range(1, 1499) if x[k - 1] < x[k] >= x[k + 1] and x[k] > 125.0]
    assert x[peaks[0]] == pytest.approx(192.5302, rel=0.03)
    assert x[peaks[1]] == pytest.approx(170.2524, rel=0.04)
    periods = np.diff(run.t[peaks[:4]])
    assert 1.0 / periods.mean() == pytest.approx(160.0, rel=0.03)
    # Successive peaks above the end decay as exp(-2 pi zeta / sqrt(1 - zeta^2)).
    ratio = (x[peaks[2]] - x[-1]) / (x[peaks[1]] - x[-1])
    expected = math.exp(-2 * math.pi * 0.065 / math.sqrt(1 - 0.065**2))
    assert ratio == pytest.approx(expected, rel=0.05)


def test_the_noise_at_rest_is_the_published_one() -> None:
    """Fig. 3: 0.097 um rms in steps of 0.038 um, band-limited."""
    run = STAGE.simulate(np.zeros(50000), FAST)
    steps = run.y / STAGE.sensor.resolution
    assert np.abs(steps - np.round(steps)).max() < 1e-6
    noise = run.y - run.x
    assert noise.std() == pytest.approx(0.097e-6, rel=0.03)
    neighbours = np.mean(noise[1:] * noise[:-1]) / noise.var()
    expected = math.exp(-2 * math.pi * STAGE.sensor.noise_bandwidth * FAST)
    assert neighbours == pytest.approx(expected, abs=0.05)
    # Preconditioned, with the sensor at zero: only creep is left.
    assert np.abs(run.x).max() < 1e-6


def test_the_same_seed_gives_the_same_reading_and_no_other_does() -> None:
    u = np.linspace(0.0, 10.0, 500)
    first, again = STAGE.simulate(u, FAST), pt.VirtualStage.xu_li_2010(seed=1).simulate(u, FAST)
    other = pt.VirtualStage.xu_li_2010(seed=2).simulate(u, FAST)
    assert first.y.tobytes() == again.y.tobytes() != other.y.tobytes()
    assert first.x.tobytes() == other.x.tobytes()


def test_shapes_units_and_times() -> None:
    u = [0, 1, 2, 1, 0]
    run = STAGE.simulate(u, 1e-3)
    for name in ("t", "u", "applied", "x", "y"):
        array = getattr(run, name)
        assert array.shape == (5,)
        assert array.dtype == np.float64
    assert run.t.tolist() == pytest.approx([0.0, 1e-3, 2e-3, 3e-3, 4e-3])
    assert run.u.tolist() == u


def test_without_an_amplifier_and_a_sensor_it_shows_what_it_is() -> None:
    bare = quiet(bandwidth=math.inf, slew=math.inf, range=math.inf)
    u = 37.5 - 37.5 * np.cos(2 * np.pi * np.arange(2000) / 2000)
    run = bare.simulate(u, 1e-3)
    assert np.array_equal(run.applied, u)
    # The sensor is set to 0 where the experiment begins.
    assert np.allclose(run.y, run.x, rtol=0.0, atol=1e-15)
    assert abs(run.x[0]) < 1e-9


def test_the_amplifier_has_its_limits_bandwidth_and_slew() -> None:
    run = STAGE.simulate(np.full(500, 90.0), FAST, hold="zoh")
    assert run.applied.max() <= 75.0
    assert run.applied[-1] == pytest.approx(75.0, abs=1e-6)
    slow = quiet(slew=1000.0).simulate(np.full(500, 50.0), FAST, hold="zoh")
    assert np.diff(slow.applied).max() == pytest.approx(1000.0 * FAST, rel=1e-6)
    first = quiet(slew=math.inf, bandwidth=100.0).simulate(np.full(50, 50.0), FAST, hold="zoh")
    expected = 50.0 * (1.0 - np.exp(-2 * np.pi * 100.0 * first.t))
    assert np.abs(first.applied - expected).max() < 0.05


@pytest.mark.parametrize("bandwidth", [1e-3, 1e-9, 1e-300, 1e-306])
def test_an_amplifier_far_slower_than_its_step_lags_by_its_time_constant(bandwidth: float) -> None:
    slow = quiet(slew=math.inf, bandwidth=bandwidth).simulate(np.linspace(0.0, 50.0, 500), FAST)
    # The integral of the ramp over the time constant, which is far longer than the record.
    expected = 2 * np.pi * bandwidth * np.trapezoid(slow.u, slow.t)
    assert slow.applied[-1] == pytest.approx(expected, rel=1e-3, abs=5e-324)


def test_the_loop_is_rate_independent_and_a_tenth_wide() -> None:
    """What Table 1 is not: piezo hysteresis does not grow with the frequency."""
    stage = quiet(creep_weights=(0.0, 0.0, 0.0))
    widths = []
    for frequency in (0.1, 1.0):
        n = round(2 / frequency / 1e-3)
        u = 37.5 - 37.5 * np.cos(2 * np.pi * frequency * 1e-3 * np.arange(n))
        run = stage.simulate(u, 1e-3)
        last = slice(n // 2, n)
        up, down = np.array_split(run.x[last], 2)
        going, coming = np.array_split(u[last], 2)
        grid = np.linspace(5.0, 70.0, 100)
        there = np.interp(grid, going, up)
        back = np.interp(grid, coming[::-1], down[::-1])
        widths.append((back - there).max() / np.ptp(run.x[last]))
    assert widths[0] == pytest.approx(0.10, abs=0.01)
    # At 1 Hz the amplifier's lag of 0.7 ms adds its share.
    assert widths[1] == pytest.approx(widths[0], abs=0.006)


def test_creep_goes_on_after_a_step() -> None:
    """0.4 % of the displacement with each of 0.1, 1 and 10 s, on a stage that never moved."""
    virgin = quiet(preconditioning=None)
    run = virgin.simulate(np.full(20001, 75.0), 1e-3, hold="zoh")

    def crept(t: float) -> float:
        return 1.0 + sum(0.004 * (1 - math.exp(-t / tau)) for tau in (0.1, 1.0, 10.0))

    for t in (0.3, 1.0, 5.0):
        found = run.x[round(1000 * t)] / run.x[20000]
        assert 1.0 - found == pytest.approx(1.0 - crept(t) / crept(20.0), rel=0.02), t
    rest = quiet(creep_weights=(), creep_times=()).simulate(np.full(20001, 75.0), 1e-3, hold="zoh")
    assert np.ptp(rest.x[2000:]) < 1e-12


def test_its_log_can_be_identified() -> None:
    t = np.arange(1001) / 250.0
    log = STAGE.record(37.5 - 37.5 * np.cos(0.5 * np.pi * t), 1 / 250.0)
    assert isinstance(log, pt.Dataset)
    assert (len(log), log.dt, log.hold) == (1001, 1 / 250.0, "foh")
    assert np.array_equal(log.y, STAGE.simulate(log.u, log.dt).y)
    fit = pt.identify(
        log,
        "dahl",
        parameters={**BOX, **HELD},
        method=pt.ParticleSwarm(particles=12, iterations=60, seed=1),
    )
    assert fit.fitted.max_error < 5e-6
    assert STAGE.record(log.u, log.dt, hold="zoh").hold == "zoh"


BAD: list[tuple[dict[str, Any], str]] = [
    ({"bandwidth": 0.0}, "bandwidth is 0 Hz"),
    ({"slew": -1.0}, "slew is -1 V/s"),
    ({"limits": (75.0, 0.0)}, "expected the lower one below"),
    ({"limits": (0.0, 1.0, 2.0)}, r"limits are \(0.0, 1.0, 2.0\): expected \(low, high\) in V"),
    ({"limits": 75.0}, "limits are"),
    ({"stage": None}, "stage is None: expected a stage of a model"),
    ({"amplifier": 225.0}, "amplifier is 225.0: expected pt.stages.Amplifier"),
    ({"preconditioning": True}, "preconditioning is True: expected pt.stages.Preconditioning"),
    ({"noise": -1e-9}, "noise is .* m"),
    ({"noise": math.nan}, "noise is NaN"),
    ({"noise": "0"}, "noise is '0'"),
    ({"noise_bandwidth": 0.0}, "noise_bandwidth is 0 Hz"),
    ({"resolution": -1.0}, "resolution is -1 m"),
    ({"range": 0.0}, "range is 0 m"),
    ({"delay": -1.0}, "delay is -1 s"),
    ({"offset": math.inf}, "offset is inf m"),
    ({"seed": -1}, "seed is -1"),
    ({"seed": 1.5}, "seed is 1.5"),
    ({"preconditioning": pt.stages.Preconditioning(swing=0.0)}, "swing is 0 V"),
    (
        {"preconditioning": pt.stages.Preconditioning(swing=75.0, rest=1e9)},
        "rest is 1000000000 s",
    ),
    ({"step": 0.0}, "step is 0 s"),
]


@pytest.mark.parametrize(("changes", "message"), BAD, ids=[message for _, message in BAD])
def test_refuses_a_bad_number(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(pt.ParameterError, match=message):
        changed(STAGE, **changes)


# Of an identified model.

PLAYS = pt.PrandtlIshlinskiiStage(
    linear=1e-6, thresholds=(5.0, 20.0), weights=(0.2e-6, 0.1e-6), time_constant=2e-3
)
MODEL = pt.identification.IdentifiedModel(
    model=PLAYS, offset=3e-6, offset_fitted=True, stroke=60e-6, delay=4e-3
)
WAVE = 30.0 - 30.0 * np.cos(2 * np.pi * 1e-3 * np.arange(3000))


def test_an_identified_model_is_a_virtual_stage_with_its_offset_and_delay() -> None:
    stage = pt.VirtualStage.of(MODEL)
    assert stage.stage is PLAYS
    assert (stage.sensor.offset, stage.sensor.delay) == (3e-6, 4e-3)
    found = stage.record(WAVE, 1e-3)
    assert np.abs(found.y - MODEL.displacement(WAVE, 1e-3)).max() < 1e-9
    # Its own delay stays where no other is named.
    assert pt.VirtualStage.of(MODEL, delay=0.0).sensor.delay == 0.0


def test_noise_is_added_to_the_reading_alone() -> None:
    clean = pt.VirtualStage.of(MODEL).simulate(WAVE, 1e-3)
    noisy = pt.VirtualStage.of(MODEL, noise=20e-9, seed=3).simulate(WAVE, 1e-3)
    assert np.array_equal(noisy.x, clean.x)
    assert (noisy.y - clean.y).std() == pytest.approx(20e-9, rel=0.05)


def test_creep_and_a_mode_take_the_place_of_the_models_own() -> None:
    stage = pt.VirtualStage.of(MODEL, creep={0.1: 0.01, 1.0: 0.02}, mode=(80.0, 0.1))
    assert stage.stage.creep_times == (0.1, 1.0)
    assert stage.stage.creep_weights == (0.01, 0.02)
    assert stage.stage.time_constant is None
    ringing = stage.simulate([10.0] * 4000, 1e-4, hold="zoh").x
    peak = 1e-4 * int(np.argmax(ringing))
    assert peak == pytest.approx(0.5 / (80.0 * math.sqrt(1 - 0.1**2)), rel=0.02)
    # Mass and damping of a stage that has them; its stiffness, and so its stroke, stay.
    dahl = pt.DahlStage.xu_li_2010()
    other = pt.VirtualStage.of(dahl, mode=(50.0, 0.2)).stage
    assert other.stiffness == dahl.stiffness
    assert math.sqrt(other.stiffness / other.mass) == pytest.approx(2 * math.pi * 50.0)
    assert other.damping == pytest.approx(2 * 0.2 * math.sqrt(other.stiffness * other.mass))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"stage": 3}, "stage is int: expected an identified model"),
        ({"creep": 0.01}, "creep is 0.01: expected the share of each time constant in s"),
        ({"mode": 160.0}, r"mode is \(160.0,\): expected \(frequency in Hz, damping ratio\)"),
        ({"stage": pt.DahlStage.xu_li_2010(), "mode": (0.0, 0.1)}, r"mode\[0\] is 0: expected"),
        ({"noise": -1.0}, "noise is -1 m"),
    ],
)
def test_of_refuses_what_it_cannot_make(given: dict[str, Any], message: str) -> None:
    with pytest.raises(pt.ParameterError, match=message):
        pt.VirtualStage.of(**{"stage": MODEL, **given})


def test_a_short_name_is_printed() -> None:
    assert repr(STAGE) == (
        "<VirtualStage, Prandtl-Ishlinskii, amplifier 225 Hz, noise 96.4 nm rms, preconditioned>"
    )


@pytest.mark.parametrize(
    ("u", "dt", "hold", "kind", "message"),
    [
        ([0.0, 1.0], 0.0, "foh", pt.ParameterError, "dt is 0 s"),
        ([0.0, 1.0], "1", "foh", pt.ParameterError, "dt is '1'"),
        ([0.0, math.nan], 1e-3, "foh", pt.DataError, r"u\[1\] is NaN"),
        ([0.0, 1.0], 1e-3, "line", pt.ParameterError, "hold is 'line'"),
        ([[0.0, 1.0]], 1e-3, "foh", pt.ShapeError, "expected a one-dimensional array"),
        (1.0, 1e-3, "foh", pt.ShapeError, "expected a one-dimensional array"),
    ],
)
def test_refuses_a_bad_drive(
    u: Any, dt: Any, hold: Any, kind: type[Exception], message: str
) -> None:
    with pytest.raises(kind, match=message):
        STAGE.simulate(u, dt, hold=hold)
