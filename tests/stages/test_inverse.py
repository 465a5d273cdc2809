"""The inverse of a Dahl stage: equation (21) by other means, and what it does to its own stage."""

from __future__ import annotations

import copy
import dataclasses
import itertools
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import all_stages
import piezotrack as pt

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

TABLE_1 = pt.DahlStage.xu_li_2010()
# A mode of 160 Hz with zeta = 0.065, Table 1's hysteresis; and all numbers different.
MASS = TABLE_1.stiffness / (2 * math.pi * 160.0) ** 2
LIGHT = dataclasses.replace(
    TABLE_1, mass=MASS, damping=2 * 0.065 * math.sqrt(MASS * TABLE_1.stiffness)
)
OTHER = pt.DahlStage(
    mass=0.4,
    damping=900.0,
    stiffness=6e4,
    piezo_coefficient=0.11,
    a1=2e3,
    a2=4e7,
    b1=-2e7,
    up=20.0,
)
STAGES = {"table 1": TABLE_1, "light": LIGHT, "other": OTHER}
FAST, LOOP = 2e-4, 0.02


def from_zero(reference: pt.Reference, start: float = 0.0) -> pt.Reference:
    """Shift it to begin where the stage is: the memory of a start elsewhere would be kept."""
    shift = start - float(reference.at(0.0)[0])

    def motion(t: Array) -> tuple[Array, Array, Array]:
        x, v, a = reference.motion(t)
        return x + shift, v, a

    low, high = reference.low + shift, reference.high + shift
    return dataclasses.replace(reference, motion=motion, low=low, high=high)


# Slow enough for straight lines between samples: what they cut off is a dt^2 / 12.
REFERENCES: dict[str, Callable[[], pt.Reference]] = {
    "sine": lambda: pt.sine(frequency=0.5, low=0.0, high=110e-6, duration=4.0),
    "multisine": lambda: from_zero(
        pt.multisine(frequencies=[0.5, 1.5, 2.5], low=5e-6, high=90e-6, duration=4.0, seed=3)
    ),
    "triangle": lambda: pt.triangle(frequency=1.0, low=0.0, high=80e-6, duration=3.0, rounding=0.2),
    "chirp": lambda: pt.chirp(
        start_frequency=0.2, stop_frequency=3.0, low=0.0, high=60e-6, duration=5.0
    ),
}


@pytest.mark.parametrize("stage", STAGES)
@pytest.mark.parametrize("name", REFERENCES)
def test_leads_its_own_stage_within_a_tenth_of_a_nanometre(stage: str, name: str) -> None:
    model, reference = STAGES[stage], REFERENCES[name]()
    volts = model.inverse().voltage(reference, FAST)
    desired = reference.sample(FAST)
    x = model.simulate(volts, FAST).x
    start_up = desired.t > 0.5
    assert np.abs(x - desired.x)[start_up].max() < 0.1e-9
    assert np.ptp(desired.x) > 50e-6


def force_by_scipy(stage: pt.DahlStage, path: Array) -> tuple[Array, Array]:
    """q1 and q2 of (7) and (8) along a path that is monotone between its entries, from rest."""
    q = np.zeros(2)
    kept = [q]
    for here, there in itertools.pairwise(path):
        sign = np.sign(there - here)
        if sign != 0.0:

            def slope(x: float, q: Array, sign: float = sign) -> list[float]:
                del x
                return [q[1], stage.up - stage.a2 * q[0] - sign * stage.a1 * q[1]]

            q = solve_ivp(slope, (here, there), q, rtol=1e-11, atol=1e-18).y[:, -1]
        kept.append(q)
    q1, q2 = np.array(kept).T
    return q1, q2


@pytest.mark.parametrize("b0", [0.0, 2e3])
@pytest.mark.parametrize("stage", STAGES)
def test_is_equation_21(stage: str, b0: float) -> None:
    """In an independent transcription, within 1e-6 V, which is 2 pm: the series has four terms."""
    model = dataclasses.replace(STAGES[stage], b0=b0)
    reference = pt.sine(frequency=0.5, low=0.0, high=110e-6, duration=5.0, ramp=0.0)
    volts = model.inverse().voltage(reference, LOOP)
    t = LOOP * np.arange(250)
    w, r = math.pi, 55e-6
    x, v, a = r - r * np.cos(w * t), r * w * np.sin(w * t), r * w * w * np.cos(w * t)
    v[::50] = 0.0
    q1, q2 = force_by_scipy(model, x)
    # sgn(0) = 0, at the turning points.
    hysteresis = model.b1 * q1 + np.sign(v) * b0 * q2
    total = model.mass * a + model.damping * v + model.stiffness * x + hysteresis
    expected = total / model.piezo_coefficient
    inside = np.arange(250) % 50 != 0
    assert np.allclose(volts[inside], expected[inside], rtol=0.0, atol=1e-6)
    # Where it turns, the velocity of the reference is 0 up to rounding only.
    session = model.inverse().start(LOOP)
    played = [session.step(*row[:1], velocity=row[1], acceleration=row[2]) for row in
              np.stack([x, v, a], axis=1).tolist()]  # fmt: skip
    assert np.allclose(played, expected, rtol=0.0, atol=1e-6)


def test_at_a_standstill_dry_friction_counts_nothing() -> None:
    """Equation (21) with sgn(0) = 0; moving either way the term has the sign of the velocity."""
    stage = dataclasses.replace(TABLE_1, b0=5e3)
    bare = TABLE_1.inverse()
    for velocity in (0.0, 1e-9, -1e-9):
        step = {"velocity": velocity, "acceleration": 0.0}
        with_b0 = stage.inverse().start(LOOP).step(20e-6, **step)
        without = bare.start(LOOP).step(20e-6, **step)
        q2 = force_by_scipy(stage, np.array([0.0, 20e-6]))[1][-1]
        friction = np.sign(velocity) * 5e3 * q2 / stage.piezo_coefficient
        assert with_b0 - without == pytest.approx(friction, rel=1e-8, abs=1e-12)


# The table.


@pytest.mark.parametrize("settle", [1, 3])
def test_the_table_is_the_settled_period(settle: int) -> None:
    reference = REFERENCES["sine"]()
    inverse = dataclasses.replace(TABLE_1.inverse(), settle=settle)
    table = inverse.table(reference, LOOP)
    assert table.shape == (100,)
    long = dataclasses.replace(reference, duration=2.0 * (settle + 1))
    path = inverse.voltage(long, LOOP)
    assert np.array_equal(table, path[-100:])
    played, how = inverse.played(dataclasses.replace(reference, duration=20.0), LOOP)
    assert f"period {settle + 1}," in how
    assert np.array_equal(played[: 100 * (settle + 1)], path)
    for turn in range(settle + 1, 10):
        assert np.allclose(played[100 * turn : 100 * (turn + 1)], table, rtol=0.0, atol=1e-9)


def test_the_printed_model_drifts_and_its_table_does_not() -> None:
    """V* attracts the hysteresis along the path, so periods never repeat."""
    reference = dataclasses.replace(REFERENCES["sine"](), duration=40.0)
    table, how = TABLE_1.inverse().played(reference, LOOP)
    online, other = dataclasses.replace(TABLE_1.inverse(), playback="online").played(
        reference, LOOP
    )
    assert how != other == "feedforward computed for the whole run"
    assert np.ptp(table[200:].reshape(-1, 100), axis=0).max() < 1e-9
    assert np.ptp(online[200:].reshape(-1, 100), axis=0).max() > 1.0


def test_the_table_repeats_after_a_fraction_of_a_sample_too() -> None:
    """0.3 Hz at 50 Hz is 166.7 samples: three periods are 500."""
    reference = pt.sine(frequency=0.3, low=0.0, high=100e-6, duration=30.0)
    volts, how = TABLE_1.inverse().played(reference, LOOP)
    assert "repeated" in how
    late = volts[334:]
    assert np.allclose(late[500:], late[:-500], rtol=0.0, atol=1e-9)
    # The settled period itself, from a fine grid, at the instants of each later one.
    fine = TABLE_1.inverse().voltage(dataclasses.replace(reference, duration=20 / 3), 1e-3)
    t = LOOP * np.arange(334, 1500)
    place = 10 / 3 + np.mod(t, 10 / 3)
    expected = np.interp(place, 1e-3 * np.arange(fine.size), fine)
    # One period later the drift of the model shows, at the seam alone.
    inner = np.abs(np.mod(t, 10 / 3) - 5 / 3) < 1.6
    assert np.abs(late - expected)[inner].max() < 0.01


def test_the_smooth_start_is_never_in_the_table() -> None:
    reference = pt.sine(frequency=0.5, low=0.0, high=100e-6, duration=12.0, ramp=4.0)
    volts, how = TABLE_1.inverse().played(reference, LOOP)
    assert "period 3" in how
    top = TABLE_1.inverse().voltage(reference, LOOP).reshape(-1, 100).max(axis=1)
    assert top[1] < 0.9 * top[2]
    assert volts.reshape(-1, 100).max(axis=1)[3:] == pytest.approx(top[2], abs=1e-9)
    assert TABLE_1.inverse().table(reference, LOOP).max() == pytest.approx(top[2], abs=1e-9)


def test_a_record_that_ends_before_it_settles_has_no_table() -> None:
    x = 1e-5 - 1e-5 * np.cos(2 * np.pi * np.arange(150) / 100)
    record = pt.Reference.from_samples(x, LOOP, period=2.0)
    with pytest.raises(pt.ParameterError, match="lasts 3 s: expected 4 s"):
        TABLE_1.inverse().table(record, LOOP)
    assert np.isfinite(TABLE_1.inverse().played(record, LOOP)[0]).all()


# Sample by sample.


@pytest.mark.parametrize("name", REFERENCES)
def test_online_with_derivatives_is_the_voltage_of_the_whole(name: str) -> None:
    reference = REFERENCES[name]()
    inverse = pt.Inverse(stage=OTHER, offset=2e-6)
    samples = reference.sample(LOOP)
    session = inverse.start(LOOP)
    rows = np.stack([samples.x, samples.v, samples.a], axis=1).tolist()
    volts = [session.step(x, velocity=v, acceleration=a) for x, v, a in rows]
    assert np.array_equal(volts, inverse.voltage(reference, LOOP))
    session.reset()
    assert session.step(rows[0][0], velocity=rows[0][1], acceleration=rows[0][2]) == volts[0]


def test_a_preview_is_close_and_without_one_it_is_half_a_sample_late() -> None:
    """Table 1 is viscous: D/T = 55 V s/mm, and the velocity is what is late."""
    reference = pt.sine(frequency=0.5, low=0.0, high=110e-6, duration=6.0)
    exact = TABLE_1.inverse().voltage(reference, LOOP)
    x = reference.sample(LOOP).x.tolist()
    ahead, behind = TABLE_1.inverse().start(LOOP), TABLE_1.inverse().start(LOOP)
    near = np.array([ahead.step(now, preview=then) for now, then in itertools.pairwise(x)])
    far = np.array([behind.step(now) for now in x])
    viscous = TABLE_1.damping / TABLE_1.piezo_coefficient
    # Velocity between the samples: half a sample early.
    a = reference.sample(LOOP).a
    lag = -viscous * 0.5 * LOOP * a
    settled = slice(100, 299)
    assert np.abs(near - exact[:-1])[settled].max() < 0.01
    assert np.abs(far - exact - lag)[settled].max() < 0.01
    assert np.abs(far - exact)[settled].max() > 0.25


def test_a_hole_in_the_reference_leaves_nothing_behind() -> None:
    x = pt.sine(frequency=0.5, low=0.0, high=110e-6, duration=4.0).sample(LOOP).x.tolist()
    whole, holed = TABLE_1.inverse().start(LOOP), TABLE_1.inverse().start(LOOP)
    expected = np.array([whole.step(value) for value in x])
    x[70], x[120] = math.nan, math.inf
    volts = np.array([holed.step(value) for value in x])
    assert np.flatnonzero(np.isnan(volts)).tolist() == [70, 120]
    good = np.isfinite(volts)
    # The velocity that was kept is off by a T a few samples long.
    assert np.abs(volts - expected)[good].max() < 0.8
    assert np.abs(volts - expected)[125:].max() < 1e-3
    assert np.isfinite(volts[125:]).all()


def test_sessions_of_an_inverse_know_nothing_of_each_other() -> None:
    inverse = TABLE_1.inverse()
    one, other, alone = (inverse.start(LOOP) for _ in range(3))
    for k in range(50):
        value = one.step(1e-6 * k)
        other.step(50e-6 - 1e-6 * k)
        assert alone.step(1e-6 * k) == value


# Offset and delay.


@pytest.mark.parametrize("delay", [0.0, 3e-3])
def test_offset_and_delay_of_what_measured_it(delay: float) -> None:
    known = pt.identification.IdentifiedModel(
        model=TABLE_1,
        offset=-2.5e-6,
        offset_fitted=True,
        scale_assumed=False,
        stroke=119e-6,
        delay=delay,
    )
    reference = from_zero(REFERENCES["multisine"](), -2.5e-6)
    volts = known.inverse().voltage(reference, FAST)
    shown = known.displacement(volts, FAST)
    desired = reference.sample(FAST)
    after = desired.t > 1.0
    assert np.abs(shown - desired.x)[after].max() < 0.2e-9
    # Without them it is off by as much as they are worth.
    bare = known.displacement(TABLE_1.inverse().voltage(reference, FAST), FAST)
    off = reference.at(np.maximum(desired.t - delay, 0.0))[0] - 2.5e-6
    # The hysteresis knows that the path began 2.5 um away.
    assert np.abs(bare - off)[after].max() < 2e-8


def test_online_the_delay_leads_too() -> None:
    inverse = pt.Inverse(stage=TABLE_1, delay=3e-3)
    reference = REFERENCES["sine"]()
    samples = reference.sample(LOOP)
    session = inverse.start(LOOP)
    rows = np.stack([samples.x, samples.v, samples.a], axis=1).tolist()
    volts = np.array([session.step(x, velocity=v, acceleration=a) for x, v, a in rows])
    # The acceleration is held along the delay: the jerk that is left out is w^3 r delay^2 / 2.
    ahead = inverse.voltage(reference, LOOP)
    late = TABLE_1.inverse().voltage(reference, LOOP)
    assert np.abs(volts - ahead)[50:].max() < 0.02 * np.abs(volts - late)[50:].max()


# What it refuses.

SINE = REFERENCES["sine"]()
BAD: dict[str, tuple[Callable[[], Any], str]] = {
    "stage": (lambda: pt.Inverse(stage=5), "stage is 5"),  # type: ignore[arg-type]
    "offset": (lambda: pt.Inverse(stage=TABLE_1, offset=math.nan), "offset is nan"),
    "delay": (lambda: pt.Inverse(stage=TABLE_1, delay=-1e-3), "delay is -0.001"),
    "playback": (
        lambda: pt.Inverse(stage=TABLE_1, playback="both"),  # type: ignore[arg-type]
        "playback is",
    ),
    "settle": (lambda: pt.Inverse(stage=TABLE_1, settle=0), "settle is 0"),
    "reference": (lambda: TABLE_1.inverse().voltage(5, 0.02), "reference is"),  # type: ignore[arg-type]
    "of a table": (lambda: TABLE_1.inverse().table(5, 0.02), "reference is"),  # type: ignore[arg-type]
    "played": (lambda: TABLE_1.inverse().played("x", 0.02), "reference is"),  # type: ignore[arg-type]
    "dt": (lambda: TABLE_1.inverse().voltage(SINE, 0.0), "dt is 0"),
    "dt of a table": (lambda: TABLE_1.inverse().table(SINE, -1.0), "dt is -1"),
    "dt of a session": (lambda: TABLE_1.inverse().start(math.nan), "dt is nan"),
    "coarse": (lambda: TABLE_1.inverse().voltage(SINE, 1.5), "dt is 1.5"),
    "no period": (
        lambda: TABLE_1.inverse().table(REFERENCES["chirp"](), 0.02),
        r"reference \(chirp",
    ),
    "a fraction": (
        lambda: TABLE_1.inverse().table(
            pt.sine(frequency=0.3, low=0.0, high=1e-5, duration=9.0), 0.02
        ),
        "dt is 0.02",
    ),
    "text": (lambda: TABLE_1.inverse().start(0.02).step("1"), "reference is '1'"),  # type: ignore[arg-type]
    "preview": (
        lambda: TABLE_1.inverse().start(0.02).step(1e-6, preview="1"),  # type: ignore[arg-type]
        "preview is '1'",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_refuses(name: str) -> None:
    call, begin = BAD[name]
    with pytest.raises(pt.ParameterError, match=f"^{begin}"):
        call()


def test_the_wording_of_a_refusal() -> None:
    with pytest.raises(pt.ParameterError) as caught:
        pt.Inverse(stage=5)  # type: ignore[arg-type]
    assert str(caught.value) == "stage is 5: expected a stage, as a pt.DahlStage"


@pytest.mark.parametrize(
    "model",
    [
        "dahl",
        "bouc-wen",
        "asymmetric-bouc-wen",
        "first-order-dahl",
        "parallel-dahl",
        "lugre",
        "bouc-wen-oscillator",
    ],
)
def test_a_state_is_refused_where_the_inverse_begins_at_rest(model: str) -> None:
    stage = all_stages.STAGES[model]
    final = stage.simulate([0.0, 1.0], 0.01).final
    with pytest.raises(pt.ParameterError, match=r"^initial is a state: expected none"):
        stage.inverse(initial=final)


def test_a_reference_too_far_for_any_piezo_is_told_where() -> None:
    far = pt.Reference(
        name="far", duration=1.0, low=0.0, high=0.5, motion=lambda t: (0.5 * t, 0.5 + 0 * t, 0 * t)
    )
    with pytest.raises(pt.NumericalError, match="no voltage for sample 1 of the reference"):
        TABLE_1.inverse().voltage(far, LOOP)


# Plays that a piezo may have; they reach 98.1 um at 75 V.
PLAYS = pt.PrandtlIshlinskiiStage(
    linear=8e-7, thresholds=(3.0, 8.0, 15.0, 25.0), weights=(2e-7, 1e-7, 2e-7, 1e-7)
)
OVERDRIVEN = {
    "plays": PLAYS,
    "asymmetric, creep": dataclasses.replace(
        PLAYS,
        dead_zone_thresholds=(30e-6,),
        dead_zone_weights=(0.2,),
        creep_weights=(0.02, 0.01),
        creep_times=(0.05, 1.0),
    ),
    "bouc-wen": pt.BoucWenStage.xu_li_2010_corrected(),
}


def overdriven(t: Any) -> Any:
    """Displacement of three periods; the middle one has a peak that is far out of reach [m]."""
    top = np.where((t > 1.0) & (t < 2.0), 140e-6, 80e-6)
    return 20e-6 + (top - 20e-6) * 0.5 * (1.0 - np.cos(2.0 * np.pi * t))


@pytest.mark.parametrize("name", OVERDRIVEN)
def test_an_inverse_is_exact_again_after_it_was_clipped(name: str) -> None:
    """A stage that got 75 V has the memory of 75 V, whatever the inverse asked for."""
    stage, dt, limits = OVERDRIVEN[name], 1e-3, (-30.0, 75.0)
    t = np.arange(0.0, 3.0, dt)
    session = stage.inverse().start(dt, limits=limits)
    v = np.gradient(overdriven(t), dt)
    a = np.gradient(v, dt)
    x = overdriven(t)
    u = np.array(
        [
            session.step(one, velocity=speed, acceleration=change)
            for one, speed, change in zip(x, v, a, strict=True)
        ]
    )
    error = stage.simulate(np.clip(u, *limits), dt).x - x
    clipped = (u < limits[0]) | (u > limits[1])
    before, after = t < t[clipped][0], t > t[clipped][-1] + 0.05
    assert 0.05 < clipped.mean() < 0.4
    assert np.abs(error[clipped]).max() > 5e-6
    # Between samples the creep and the dynamics go on, before as well as after.
    assert np.abs(error[after]).max() < max(1e-9, 1.5 * np.abs(error[before & (t > 0.05)]).max())


def test_an_amplifier_that_reports_its_voltage_leaves_the_inverse_exact() -> None:
    dt, t = 1e-3, np.arange(0.0, 3.0, 1e-3)
    loop = pt.Controller(dt=dt, limits=(-30.0, 150.0), feedforward=PLAYS.inverse())
    session, u = loop.start(), np.empty(t.size)
    for k, x in enumerate(overdriven(t)):
        # It gives no more than 75 V, of which the limits know nothing.
        u[k] = min(session.step(x, 0.0), 75.0)
        session.applied(u[k])
    error = PLAYS.simulate(u, dt).x - overdriven(t)
    assert np.abs(error[(t > 1.2) & (t < 1.8)]).max() > 5e-6
    assert np.abs(error[t > 2.0]).max() < 1e-9


@pytest.mark.parametrize("playback", ["online", "table"])
def test_a_tracked_run_is_exact_again_after_it_was_clipped(playback: Any) -> None:
    loop = pt.Controller(
        dt=1e-3, limits=(-30.0, 75.0), feedforward=PLAYS.inverse(playback=playback)
    )
    course = pt.sine(frequency=1.0, low=0.0, high=110e-6, duration=6.0)
    run = pt.track(PLAYS, loop, course, beyond_reach=True)
    assert 0.1 < run.saturated.mean() < 0.3
    # The voltage of a sample acts at the next.
    lag = run.displacement[1:] - run.desired[:-1]
    free = ~run.saturated[:-1] & (run.t[:-1] > 2.0) & (run.desired[:-1] < 60e-6)
    assert np.abs(lag[free]).max() < 1e-9


def test_the_limits_of_a_session_are_those_of_its_controller() -> None:
    """Also of one that it is changed to, and after a copy."""
    t = np.arange(0.0, 3.0, 1e-3)
    loop = pt.Controller(dt=1e-3, limits=(-30.0, 150.0), feedforward=PLAYS.inverse())
    session = loop.start()
    session.retune(dataclasses.replace(loop, limits=(-30.0, 75.0)))
    u = np.empty(t.size)
    for k, x in enumerate(overdriven(t)):
        u[k] = session.step(x, 0.0)
        if k == 1300:
            session = copy.copy(session)
    error = PLAYS.simulate(u, 1e-3).x - overdriven(t)
    assert np.abs(error[t > 2.0]).max() < 1e-9
