"""Diagnostics: warnings of an unsound record, none of a sound one."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from folders import MEASURED
from piezotrack.data.checks import diagnostics
from piezotrack.data.checks.record_flags import record_flags, record_warnings
from piezotrack.xu_li_2010.demo import demo_log
from records import BOX, HELD, quick
from virtual import changed

if TYPE_CHECKING:
    from numpy.typing import NDArray

RATE = 1000.0
T = np.arange(4001) / RATE
SINE = 37.5 * (1.0 - np.cos(0.5 * np.pi * T))
SMALL = pt.ParticleSwarm(particles=6, iterations=5, polish=False)


def log(u: NDArray[np.float64]) -> pt.Dataset:
    x = pt.DahlStage.xu_li_2010().simulate(u, 1 / RATE).x
    return pt.Dataset(u=u, y=x, dt=1 / RATE)


def in_units(drive: float, displacement: float) -> pt.Dataset:
    good = log(SINE)
    return pt.Dataset(u=drive * good.u, y=displacement * good.y, dt=good.dt)


GOOD = {
    "slow sine": SINE,
    "sine about 30 V": 30.0 + 20.0 * np.sin(np.pi * T),
    "rest before a sine": np.r_[np.zeros(1000), SINE],
    "triangle": 75.0 * (1.0 - np.abs(T % 2.0 - 1.0)),
    "rest before a triangle": np.r_[np.zeros(1000), 75.0 * (1.0 - np.abs(T % 2.0 - 1.0))],
    "step": np.where(T > 0.1, 75.0, 0.0),
    "pulse": np.where((T > 0.1) & (T < 2.0), 75.0, 0.0),
    "square": 30.0 * (np.sin(2.0 * np.pi * T) > 0.0),
    "stairs up": 3.0 * np.floor(5.0 * T),
    "stairs up and down": 75.0 * (1.0 - np.abs(np.floor(5.0 * T) / 10.0 - 1.0)),
    "multisine": 30.0 + sum(5.0 * np.sin(2 * np.pi * f * T + f * f) for f in (0.5, 1.5, 2.5, 7)),
    "chirp": 30.0 + 20.0 * np.sin(2.0 * np.pi * (0.5 * T + T * T)),
    "noise": 30.0 + np.random.default_rng(1).normal(0.0, 5.0, T.size),
}


@pytest.mark.parametrize("name", GOOD)
def test_nothing_is_said_of_a_good_record(name: str) -> None:
    record = log(np.asarray(GOOD[name], dtype=np.float64))
    diagnostics.check_record(record, searches_hysteresis=True)
    assert record_warnings(record) == []


@pytest.mark.parametrize("seconds", [4.0, 12.0])
def test_nothing_is_said_of_the_demonstration(seconds: float) -> None:
    record = demo_log()[:seconds]
    diagnostics.check_record(record, searches_hysteresis=True)
    assert record_warnings(record) == []


@pytest.mark.skipif(not MEASURED.is_dir(), reason=f"the measured logs are not in {MEASURED}")
def test_nothing_is_said_of_measured_logs() -> None:
    for name in ("training", "tracking"):
        whole = pt.read(MEASURED / f"{name}.csv")
        for record in (whole, whole[3.0:], whole[3.0:23.0]):
            diagnostics.check_record(record, searches_hysteresis=True)
            assert record_warnings(record) == []
    # Of one slow sine, the Dahl model takes damping for a part of the loop's width.
    fit = pt.identify(
        pt.read(MEASURED / "training.csv")[3.0:23.0], "dahl", method=pt.Descents(seed=1)
    )
    assert re.match(r"the lag of .* ms contributes .* of the travel at this rate", fit.notes[0])
    # The lag that is named is the model's, not the shortest that explains the record as well.
    fit = pt.identify(pt.read(MEASURED / "training.csv")[3.0:23.0])
    named = re.search(r"the lag of (\S+) ms", " ".join(fit.notes))
    assert named
    assert float(named[1]) == pytest.approx(1e3 * fit.model.time_constant, rel=5e-3)


# Refusals.


@pytest.mark.parametrize(
    "u", [75.0 * T / 4.0, SINE[:2000], 75.0 * np.minimum(T, 1.0), 75.0 - 75.0 * T / 4.0]
)
def test_a_drive_that_never_reverses_is_refused(u: NDArray[np.float64]) -> None:
    with pytest.raises(pt.DataError, match=r"the drive never reverses: .* up and down, or hold"):
        pt.identify(pt.Dataset(u=u, y=1.5e-6 * u, dt=1 / RATE), "dahl", method=SMALL)


def test_unless_hysteresis_is_held() -> None:
    fit = pt.identify(log(75.0 * T / 4.0), "dahl", parameters={**BOX, **HELD}, method=SMALL)
    assert "the drive never reverses: this record does not determine the hysteresis" in fit.notes
    step = pt.identify_step(pt.identification.StepReadings.xu_li_2010())
    pt.identify(log(75.0 * T / 4.0), "dahl", parameters={**step.parameters, **BOX}, method=SMALL)


def test_the_drive_before_the_window_counts() -> None:
    # The window only rises, but remembers cycles before.
    record = log(np.r_[SINE[:-1], SINE])[4.0:5.9]
    diagnostics.check_record(record, searches_hysteresis=True)
    (note,) = record_warnings(record)
    assert "shorter than a period of the drive" in note


def test_the_core_refuses_first_what_tells_nothing() -> None:
    for record, message in (
        (pt.Dataset(u=np.full(100, 2.0), y=np.arange(100.0), dt=1e-3), "the drive is constant"),
        (pt.Dataset(u=SINE, y=np.full(4001, 1e-6), dt=1e-3), "sensor seems dead"),
        (quick()[1.0:1.02], "the window has 5 samples"),
    ):
        with pytest.raises(pt.DataError, match=message):
            pt.identify(record, "dahl", method=SMALL)


# Remarks on a record.


@pytest.mark.parametrize(
    ("drive", "displacement", "pieces"),
    [
        (1.0, 1e3, ("119.1 mm", "unit of the displacement", "1e3 too large", "119.1 um")),
        (1.0, 1e6, ("119.1 m ", "unit of the displacement", "1e6 too large", "um taken as m")),
        (1.0, 1e-3, ("119.1 nm", "unit of the displacement", "1e3 too small", "um taken as nm")),
        (1.0, 1e-6, ("119.1 pm", "unit of the displacement", "1e6 too small", "um taken as pm")),
        (1e3, 1.0, ("75000 V", "in mV?", "75 V")),
        (1e-3, 1.0, ("0.075 V", "taken as mV", "1e3 too small")),
    ],
)
def test_a_wrong_unit_is_named(drive: float, displacement: float, pieces: tuple[str, ...]) -> None:
    (note,) = record_warnings(in_units(drive, displacement))
    for piece in pieces:
        assert piece in note


def test_a_wrong_unit_of_a_command_of_a_few_volts_is_named() -> None:
    # The measured stack gives 12.5 um/V; a thousandth of it is no stage's.
    (note,) = record_warnings(in_units(3.6 / 75.0, 45.0 / 119.0 * 1e-3))
    assert "1e3 too small" in note


@pytest.mark.parametrize(
    "u", [SINE[:2400], 30.0 + 20.0 * np.sin(0.5 * np.pi * T[:2400]), 75.0 - SINE[:3000]]
)
def test_less_than_a_period_is_named(u: NDArray[np.float64]) -> None:
    (note,) = record_warnings(log(u))
    assert "shorter than a period of the drive" in note
    ends = f"begins at {u[0]:.4g} V and ends at {u[-1]:.4g} V"
    ends += f", within {u.min():.4g} V to {u.max():.4g} V"
    assert ends in note


@pytest.mark.parametrize(
    ("u", "levels"),
    [
        (np.minimum(SINE, 50.0), ["50 V, its highest"]),
        (np.clip(SINE, 10.0, 60.0), ["60 V, its highest", "10 V, its lowest"]),
        (np.minimum(75.0 * (1.0 - np.abs(T % 2.0 - 1.0)), 60.0), ["60 V, its highest"]),
    ],
)
def test_a_clipped_drive_is_named(u: NDArray[np.float64], levels: list[str]) -> None:
    # A record that begins at its lowest has no cut there at the beginning.
    found = record_warnings(log(np.r_[u[:-1], u]))
    assert len(found) == len(levels)
    for note, level in zip(found, levels, strict=True):
        assert f"the drive is cut off at {level}" in note


def test_a_sensor_at_its_end_is_named() -> None:
    good = log(SINE)
    for y in (np.minimum(good.y, 90e-6), np.maximum(-good.y, -90e-6)):
        note = record_warnings(pt.Dataset(u=good.u, y=y, dt=good.dt))[-1]
        assert "90 um while the drive goes" in note
        assert "is the sensor or the stage at its end?" in note


# Remarks on a fit.


@cache
def lopsided() -> pt.Dataset:
    """A loop that is wide below and narrow above: strong plays, a bend between."""
    stage = pt.VirtualStage.xu_li_2010(seed=1)
    gain = stage.stage.linear / 0.8
    stage = changed(
        stage,
        dead_zone_thresholds=(20.0 * gain, 50.0 * gain),
        dead_zone_weights=(0.9, -1.2),
        weights=tuple(3.0 * weight for weight in stage.stage.weights),
    )
    u = 37.5 * (1.0 - np.cos(0.5 * np.pi * np.arange(8001) / RATE))
    return stage.record(u, 1 / RATE)


def test_a_loop_that_the_model_cannot_describe_is_named() -> None:
    fit = pt.identify(lopsided(), "dahl", method=pt.Descents(seed=1, runs=2))
    (note,) = [note for note in fit.notes if note.startswith("the loop")]
    for piece in ("is asymmetric", "this model cannot describe", "um near", "the drive going"):
        assert piece in note
    assert note in fit.summary()


def test_where_hysteresis_was_held_it_says_so() -> None:
    fit = pt.identify(lopsided(), "dahl", parameters=HELD, method=pt.Descents(seed=1, runs=2))
    (note,) = [note for note in fit.notes if note.startswith("the loop")]
    assert "a1, a2, b1 were held fixed: identify all" in note


@pytest.mark.parametrize("kind", ["noise", "drift", "a late displacement of a chirp"])
def test_what_does_not_follow_the_loop_is_no_loops_fault(kind: str) -> None:
    good = log(np.asarray(GOOD["chirp"]))
    rest: dict[str, Any] = {
        "noise": np.random.default_rng(1).normal(0.0, 2e-6, T.size),
        "drift": 2e-6 * T,
        "a late displacement of a chirp": good.y - np.roll(good.y, 15),
    }
    record = pt.Dataset(u=good.u, y=good.y + rest[kind], dt=good.dt)
    percent = 100.0 * float(np.std(rest[kind])) / record.stroke
    assert percent > diagnostics.REMAINS
    assert diagnostics.fit_warnings(record, good.y, percent, ("a1", "a2"), ()) == []


@pytest.mark.parametrize("size", [1e-6, -3e-6])
def test_a_jump_of_the_sensor_is_found_where_it_is(size: float) -> None:
    t = np.arange(4000) / 1000.0
    noise = np.random.default_rng(1).normal(0.0, 3e-9, t.size)
    u = 30.0 - 30.0 * np.cos(4.0 * np.pi * t)
    y = 5e-7 * u + noise
    assert record_flags(pt.Dataset(u=u, y=y, t=t)) == []
    flags = record_flags(pt.Dataset(u=u, y=y + np.where(t > 2.3, size, 0.0), t=t))
    (jump,) = (flag for flag in flags if flag.kind == "jump")
    assert np.ravel(jump.spans) == pytest.approx([2.3, 2.301])
    found = re.search(r"jumps by ([0-9.]+) ([un])m", jump.note)
    assert found is not None
    metres = float(found[1]) * {"u": 1e-6, "n": 1e-9}[found[2]]
    assert metres == pytest.approx(abs(size), rel=0.02)


def test_a_clipped_drive_and_a_sensor_at_its_end_are_found_where_they_are() -> None:
    t = np.arange(4000) / 1000.0
    u = 30.0 - 30.0 * np.cos(4.0 * np.pi * t)
    clipped = record_flags(pt.Dataset(u=np.minimum(u, 50.0), y=5e-7 * np.minimum(u, 50.0), t=t))
    (flag,) = (one for one in clipped if one.kind == "clipped")
    assert len(flag.spans) == 8
    for first, last in flag.spans:
        middle = 0.5 * (first + last) % 0.5
        assert middle == pytest.approx(0.25, abs=0.002)
    ended = record_flags(pt.Dataset(u=u, y=np.minimum(5e-7 * u, 25e-6), t=t))
    (flag,) = (one for one in ended if one.kind == "end")
    assert len(flag.spans) == 8


@pytest.mark.parametrize("shape", ["sine", "triangle"])
@pytest.mark.parametrize("mains", [50.02, 59.97])
def test_hum_is_found_in_the_log_with_its_amplitude(shape: str, mains: float) -> None:
    t = np.arange(8000) / 1000.0
    phase = t % 1.0
    wave = (
        np.cos(2.0 * np.pi * phase) if shape == "sine" else 1.0 - 4.0 * np.minimum(phase, 1 - phase)
    )
    u = 50.0 - 50.0 * wave
    plays = pt.PrandtlIshlinskiiStage(linear=4e-7, thresholds=(10.0, 25.0), weights=(1e-7, 5e-8))
    y = plays.simulate(u, 1e-3).x + np.random.default_rng(1).normal(0.0, 20e-9, t.size)
    assert record_flags(pt.Dataset(u=u, y=y, dt=1e-3)) == []
    (flag,) = record_flags(pt.Dataset(u=u, y=y + 50e-9 * np.sin(2.0 * np.pi * mains * t), dt=1e-3))
    assert flag.kind == "hum"
    assert flag.quick is not None
    (line,) = flag.quick.hum
    assert line.frequency == pytest.approx(mains, abs=0.2)
    assert line.amplitude == pytest.approx(50e-9, rel=0.1)
