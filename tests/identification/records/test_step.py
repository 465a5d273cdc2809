"""Step responses: published readings, simulated steps, and what is refused in words."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from click.testing import CliRunner

import piezotrack as pt
from folders import SHARED
from piezotrack._support.files.writing import write_columns
from piezotrack.cli.commands import app
from records import BOX, TABLE_1, quick
from virtual import changed

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Section 3 of Xu and Li 2010, as printed.
PUBLISHED = {"a1": 121.9874, "a2": 1.1773e6, "b1": 1.8485e6, "b0": 0.0}
STEADY = 117.7622e-6
NOISE, RESOLUTION = 0.097e-6, 0.038e-6
TYPED: dict[str, Any] = {
    "voltage": 75.0,
    "steady_state": 117.7622,
    "peaks": (192.5302, 170.2524),
    "period": 0.0058,
    "frequency": 160.0,
    "static_gain": 1.5759,
    "resonance_gain": 12.0806,
}


def ringing(t: NDArray[np.float64], frequency: float, zeta: float) -> NDArray[np.float64]:
    """A step of one through a mode, from t = 0 on: its closed form."""
    wn = 2.0 * np.pi * frequency
    late = np.maximum(t, 0.0)
    if zeta >= 1.0:
        fast, slow = (wn * (zeta + s * math.sqrt(zeta**2 - 1.0)) for s in (1.0, -1.0))
        both = (fast * np.exp(-slow * late) - slow * np.exp(-fast * late)) / (fast - slow)
        return np.asarray(1.0 - both)
    wd = wn * math.sqrt(1.0 - zeta**2)
    turn = np.cos(wd * late) + zeta * wn / wd * np.sin(wd * late)
    return np.asarray(1.0 - np.exp(-zeta * wn * late) * turn)


def step_log(
    seed: int | None = None,
    *,
    frequency: float = 160.0,
    zeta: float = 0.065,
    rate: float = 5000.0,
    seconds: float = 0.4,
    before: int = 200,
    height: float = 75.0,
    steady: float = STEADY,
) -> pt.Dataset:
    """A step of a mode, noisy and quantised as the published sensor where there is a seed."""
    t = np.arange(-before, round(seconds * rate)) / rate
    y = steady * ringing(t, frequency, zeta)
    if seed is not None:
        y = y + np.random.default_rng(seed).normal(0.0, NOISE, t.size)
        y = RESOLUTION * np.round(y / RESOLUTION)
    u = np.where(t >= 0.0, height, 0.0)
    return pt.Dataset(u=u, y=y, dt=1.0 / rate, hold="zoh", source="step.csv")


# The published readings.


def test_the_published_readings_give_the_published_values() -> None:
    path = SHARED / "published.json"
    step = pt.identify_step(pt.identification.StepReadings.from_um(**TYPED))
    for name, value in PUBLISHED.items():
        assert step.hysteresis[name] == pytest.approx(value, rel=1e-4, abs=1e-4), name
    assert step.hysteresis["a1"] == pytest.approx(121.9874, abs=1e-4)
    # As printed, to their last digit.
    assert step.damping_ratio == pytest.approx(0.065, abs=5e-4)
    assert step.natural_angular_frequency == pytest.approx(1005.0, abs=0.5)
    assert step.time_constant == pytest.approx(0.0153, abs=1e-4)
    # What they are in full.
    assert step.damping_ratio == pytest.approx(1.5759 / (2 * 12.0806), rel=1e-12)
    assert step.natural_angular_frequency == pytest.approx(2 * np.pi * 160.0, rel=1e-12)
    assert step.notes == ["the ringing, 172.4 Hz, and the resonance, 160 Hz, differ"]
    assert step.trace is None
    if path.is_file():
        read = json.loads(path.read_text(encoding="utf-8"))["step_response"]
        assert read["steady_state_um"] == TYPED["steady_state"]
        assert (read["peak_1_um"], read["peak_2_um"]) == TYPED["peaks"]


def test_the_published_readings_are_at_hand() -> None:
    assert pt.identification.StepReadings.xu_li_2010() == pt.identification.StepReadings.from_um(
        **TYPED
    )
    # Of the published peaks: zeta by the decrement 0.056, the first overshoot 63 %.
    step = pt.identify_step(pt.identification.StepReadings.xu_li_2010())
    assert step.damping_by_decrement == pytest.approx(0.056, abs=5e-4)
    assert step.overshoot_ratio == pytest.approx(0.635, abs=5e-4)


# What one step tells of K, T, M and D.


def test_one_step_tells_ratios_only() -> None:
    step = pt.identify_step(pt.identification.StepReadings.xu_li_2010())
    assert step.ratios["T/K"] == pytest.approx(117.7622e-6 / 75.0)
    # At M = 0.1828 kg, D is about 24 N s/m and K about 1.85e5 N/m.
    assert 0.1828 * step.ratios["K/M"] == pytest.approx(1.85e5, rel=2e-3)
    assert 0.1828 * step.ratios["D/M"] == pytest.approx(24.0, rel=2e-3)
    assert (step.stiffness, step.mass, step.damping, step.piezo_coefficient) == (None,) * 4
    assert step.model is None


def test_a_known_mass_or_stiffness_fixes_the_rest() -> None:
    by_mass = pt.identify_step(pt.identification.StepReadings.xu_li_2010(), mass=0.1828)
    assert by_mass.mass == pytest.approx(0.1828)
    assert by_mass.stiffness is not None
    assert by_mass.stiffness == pytest.approx(0.1828 * by_mass.ratios["K/M"])
    assert by_mass.damping == pytest.approx(0.1828 * by_mass.ratios["D/M"])
    again = pt.identify_step(
        pt.identification.StepReadings.xu_li_2010(), stiffness=by_mass.stiffness
    )
    assert again.model == by_mass.model
    # With Table 1's K the static level needs about Table 1's T, 0.0468 N/V.
    table = pt.identify_step(
        pt.identification.StepReadings.xu_li_2010(), stiffness=TABLE_1.stiffness
    )
    assert table.piezo_coefficient == pytest.approx(TABLE_1.piezo_coefficient, rel=0.02)


def test_a_stage_made_of_a_step_stands_where_the_step_ended() -> None:
    model = pt.identify_step(pt.identification.StepReadings.xu_li_2010(), stiffness=3e5).model
    assert model is not None
    # Slowly, so that the displacement goes straight from rest to the level.
    u = np.minimum(np.arange(6000) / 4000.0, 1.0) * 75.0
    assert model.simulate(u, 1e-3).x[-1] == pytest.approx(STEADY, rel=1e-3)


@pytest.mark.parametrize("stiffness", [1e4, 26065.0, 5e4])
def test_a_second_level_tells_stiffness_and_piezo_coefficient(stiffness: float) -> None:
    known = pt.identify_step(pt.identification.StepReadings.xu_li_2010(), stiffness=stiffness)
    assert known.model is not None
    # Creeping up to 40 V, the model says where another step would end.
    u = np.minimum(np.arange(9000) / 6000.0, 1.0) * 40.0
    level = known.model.simulate(u, 1e-3).x[-1]
    step = pt.identify_step(known.readings, second_level=(40.0, level))
    assert step.stiffness == pytest.approx(stiffness, rel=0.02)
    assert step.piezo_coefficient == pytest.approx(known.piezo_coefficient, rel=0.02)
    assert "second static level" in step.summary()


def test_a_second_level_may_be_a_step_of_its_own() -> None:
    first = pt.identify_step(step_log(1))
    lower = pt.identify_step(step_log(2, height=37.5, steady=61e-6))
    both = pt.identify_step(step_log(1), second_level=lower)
    level = (lower.readings.voltage, lower.readings.steady_state)
    assert both.stiffness == pt.identify_step(first.readings, second_level=level).stiffness


def test_levels_that_are_proportional_tell_no_stiffness() -> None:
    for level in [(37.5, STEADY / 2), (37.5, 55e-6), (75.0, STEADY)]:
        with pytest.raises(pt.DataError, match="do not determine the stiffness"):
            pt.identify_step(pt.identification.StepReadings.xu_li_2010(), second_level=level)


# Steps in a record.


@pytest.mark.parametrize("seed", range(20))
def test_a_noisy_step_gives_frequency_and_damping(seed: int) -> None:
    step = pt.identify_step(step_log(seed))
    assert step.readings.frequency == pytest.approx(160.0, rel=0.01)
    assert step.damping_ratio == pytest.approx(0.065, rel=0.1)
    assert step.damping_by_decrement == pytest.approx(0.065, rel=0.1)
    assert step.readings.steady_state == pytest.approx(STEADY, rel=1e-3)
    assert step.readings.period == pytest.approx(1.0 / (160.0 * math.sqrt(1 - 0.065**2)), rel=2e-3)
    overshoot = math.exp(-math.pi * 0.065 / math.sqrt(1.0 - 0.065**2))
    assert step.overshoot_ratio == pytest.approx(overshoot, rel=0.01)
    # In time a second-order stage has D/M = 2 zeta wn for a1 and K/M = wn^2 for a2.
    wn = 2.0 * np.pi * 160.0
    assert step.hysteresis["a1"] == pytest.approx(2 * 0.065 * wn, rel=0.02)
    assert step.hysteresis["a2"] == pytest.approx(wn * wn, rel=0.01)
    gain = 1e6 * STEADY / 75.0
    assert step.hysteresis["b1"] == pytest.approx(gain * wn * wn, rel=0.01)
    assert step.hysteresis["b0"] == 0.0
    assert step.notes == []


@pytest.mark.parametrize("zeta", [0.005, 0.02, 0.065, 0.15, 0.25])
@pytest.mark.parametrize("rate", [2500.0, 5000.0, 50000.0])
def test_a_clean_step_is_read_exactly(zeta: float, rate: float) -> None:
    step = pt.identify_step(step_log(zeta=zeta, rate=rate, seconds=0.1 / zeta**0.5))
    readings = step.readings
    assert step.damping_by_decrement == pytest.approx(zeta, rel=0.01)
    assert readings.frequency == pytest.approx(160.0 * math.sqrt(1 - 2 * zeta**2), rel=2e-3)
    assert readings.resonance_gain / readings.static_gain == pytest.approx(
        1.0 / (2 * zeta * math.sqrt(1 - zeta**2)), rel=0.02
    )
    # The peaks lie at odd multiples of half a period.
    assert step.trace is not None
    half = 0.5 / (160.0 * math.sqrt(1 - zeta**2))
    first = step.trace.peak_times[0] - step.trace.step_time - 1.0 / rate
    assert first == pytest.approx(half, abs=0.1 / rate + 0.01 * half)


def test_the_hold_between_samples_is_minded() -> None:
    zoh = step_log(rate=2000.0)
    # The same stage under a line from one sample to the next: the mean of a step over a sample.
    fine = np.arange(-8000, 16000) / 40000.0
    smooth = np.convolve(ringing(fine, 160.0, 0.065), np.ones(20) / 20, mode="full")[: fine.size]
    u = np.where(fine[::20] >= 1e-9, 75.0, 0.0)
    foh = pt.Dataset(u=u, y=STEADY * smooth[::20], dt=1 / 2000.0, hold="foh")
    one, other = pt.identify_step(zoh).readings, pt.identify_step(foh).readings
    assert one.resonance_gain == pytest.approx(other.resonance_gain, rel=2e-3)
    assert one.frequency == pytest.approx(other.frequency, rel=1e-3)


def test_a_step_down_and_a_stage_that_goes_the_other_way() -> None:
    up = pt.identify_step(step_log())
    up_log = step_log()
    down = pt.Dataset(u=75.0 - up_log.u, y=STEADY - up_log.y, dt=up_log.dt, hold="zoh")
    other = pt.Dataset(u=up_log.u, y=5e-6 - up_log.y, dt=up_log.dt, hold="zoh")
    for log, sign in ((down, 1.0), (other, -1.0)):
        step = pt.identify_step(log)
        assert step.readings.frequency == pytest.approx(up.readings.frequency)
        assert step.damping_ratio == pytest.approx(up.damping_ratio)
        assert step.hysteresis["a1"] == pytest.approx(up.hysteresis["a1"])
        assert step.ratios["T/K"] == pytest.approx(sign * up.ratios["T/K"])


def test_a_drive_that_was_measured_need_not_be_clean() -> None:
    log = step_log(3)
    noise = np.random.default_rng(7).normal(0.0, 0.05, log.u.size)
    noisy = pt.Dataset(u=log.u + noise, y=log.y, dt=log.dt, hold="zoh")
    step = pt.identify_step(noisy)
    assert step.readings.voltage == pytest.approx(75.0, abs=0.05)
    assert step.damping_ratio == pytest.approx(0.065, rel=0.05)


def test_the_virtual_stages_amplifier_shows_in_the_gains_only() -> None:
    stage = pt.VirtualStage.xu_li_2010(seed=1)
    drive = [0.0] * 100 + [75.0] * 1500
    step = pt.identify_step(stage.record(drive, 1 / 5000.0))
    assert step.readings.frequency == pytest.approx(160.0, rel=0.01)
    assert step.damping_by_decrement == pytest.approx(0.065, rel=0.1)
    assert step.overshoot_ratio == pytest.approx(0.63, abs=0.01)  # as published
    assert any("a lag of the amplifier" in note for note in step.notes)
    quick_one = changed(stage, bandwidth=math.inf)
    alone = pt.identify_step(quick_one.record(drive, 1 / 5000.0))
    assert alone.damping_ratio == pytest.approx(0.065, rel=0.1)
    assert alone.notes == []


def test_a_pulse_is_read_up_to_its_end() -> None:
    log = step_log(1)
    n = log.u.size
    u, y = np.r_[log.u, log.u[: n // 2] * 0.0], np.r_[log.y, np.zeros(n // 2)]
    step = pt.identify_step(pt.Dataset(u=u, y=y, dt=log.dt, hold="zoh"))
    assert step.readings.period == pytest.approx(pt.identify_step(log).readings.period, rel=1e-3)
    assert any("where the drive changes again" in note for note in step.notes)


# Notes.


@pytest.mark.parametrize(
    ("log", "note"),
    [
        (step_log(1, rate=1000.0), "sampled at 1000 Hz, which is slow: sample such a stage above"),
        (step_log(1, seconds=0.03), "before the ringing has died out"),
        (step_log(1, before=3), "only 3 samples before the step"),
        (step_log(1, zeta=0.3), "use the damping ratio by the decrement"),
        (step_log(1, zeta=0.3), "only two peaks are above the noise"),
    ],
)
def test_notes(log: pt.Dataset, note: str) -> None:
    assert any(note in found for found in pt.identify_step(log).notes)


def test_advice_on_sampling() -> None:
    step = pt.identify_step(pt.identification.StepReadings.xu_li_2010())
    assert step.lowest_sampling_rate == pytest.approx(1600.0)
    for piece in ("1600 Hz", "10 x the natural frequency", "20 x its bandwidth"):
        assert piece in step.advice
    assert step.advice[1:] in step.summary()


# Refusals.


def sine() -> pt.Dataset:
    t = np.arange(2000) / 1000.0
    return pt.Dataset(u=np.sin(6.28 * t), y=1e-6 * np.sin(6.28 * t), dt=1e-3)


def ramp() -> pt.Dataset:
    t = np.arange(2000) / 1000.0
    return pt.Dataset(u=np.minimum(t, 1.0), y=1e-6 * np.minimum(t, 1.0), dt=1e-3)


def constant() -> pt.Dataset:
    return pt.Dataset(u=np.full(500, 75.0), y=step_log().y[:500], dt=2e-4)


def dead() -> pt.Dataset:
    log = step_log()
    noise = np.random.default_rng(1).normal(0.0, NOISE, log.u.size)
    return pt.Dataset(u=log.u, y=noise, dt=log.dt)


def growing() -> pt.Dataset:
    log = step_log()
    return pt.Dataset(u=log.u, y=log.u * (1 + np.sin(np.arange(log.u.size) / 5)) * 1e-6, dt=log.dt)


@pytest.mark.parametrize(
    ("log", "message"),
    [
        (sine(), "no step in the drive: .* expected a voltage that jumps and stays"),
        (ramp(), "no step in the drive"),
        (constant(), "no step in the drive: it is constant at 75 V; .* before the jump"),
        (quick(), "no step in the drive"),
        (step_log(zeta=1.2), r"without an overshoot: .* overdamped, and \(9\) to \(13\), .* drive"),
        (step_log(1, zeta=0.95), "without an overshoot"),
        (step_log(1, zeta=0.6), "one overshoot .* too short, or the stage too strongly damped"),
        (step_log(1, seconds=0.003), "the record is too short"),
        (step_log(1, seconds=0.0055), "too short"),
        (step_log(1, seconds=0.009), "too short"),
        (step_log(1, rate=600.0), "the sampling is too slow: 3.7 samples in a period"),
        (dead(), "does not answer the step: .* the sensor seems dead"),
        (growing(), "does not decay"),
    ],
)
def test_refuses_a_record_in_words(log: pt.Dataset, message: str) -> None:
    with pytest.raises(pt.DataError, match=message) as caught:
        pt.identify_step(log)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "pieces"),
    [
        ({"voltage": 0.0}, ("voltage is 0 V",)),
        ({"voltage": "75"}, ("voltage is '75'", "a number")),
        ({"steady_state": math.nan}, ("steady_state is NaN m", "finite")),
        ({"peaks": (192.0,)}, ("peaks is 1 of them", "2 or more")),
        ({"peaks": (170.0, 192.0)}, ("peaks[1]", "lower than the one before")),
        ({"peaks": (192.0, 110.0)}, ("peaks[1]", "beyond the steady state")),
        ({"peaks": (192.0, None)}, ("peaks[1] is None", "a number")),
        ({"period": 0.0}, ("period is 0 s", "above 0")),
        ({"frequency": -160.0}, ("frequency is -160 Hz", "above 0")),
        ({"resonance_gain": 0.0}, ("resonance_gain is 0 m/V",)),
        ({"static_gain": math.inf}, ("static_gain is inf m/V", "finite")),
    ],
)
def test_refuses_readings_in_words(change: dict[str, Any], pieces: tuple[str, ...]) -> None:
    with pytest.raises(pt.ParameterError) as caught:
        pt.identification.StepReadings.from_um(**{**TYPED, **change})
    for piece in pieces:
        assert piece in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "pieces"),
    [
        ({"stiffness": -1.0}, ("stiffness is -1 N/m", "above 0")),
        ({"mass": 0.0}, ("mass is 0 kg", "above 0")),
        ({"mass": "1"}, ("mass is '1'", "a number")),
        ({"mass": 1.0, "stiffness": 1e4}, ("stiffness and mass are given", "expected one")),
        ({"second_level": 60e-6}, ("second_level is 6e-05", "(voltage in V, displacement in m)")),
        ({"second_level": (37.5, None)}, ("displacement of second_level is None", "a number")),
        ({"data": "step.csv"}, ("data is str", "expected a Dataset", "pt.read")),
    ],
)
def test_refuses_arguments_in_words(arguments: dict[str, Any], pieces: tuple[str, ...]) -> None:
    given: dict[str, Any] = {"data": step_log(), **arguments}
    with pytest.raises(pt.ParameterError) as caught:
        pt.identify_step(given.pop("data"), **given)
    for piece in pieces:
        assert piece in str(caught.value)


# On into the search.

SMALL = pt.ParticleSwarm(particles=6, iterations=5, polish=False)


def test_a_step_carries_its_hysteresis_into_a_search() -> None:
    step = pt.identify_step(pt.identification.StepReadings.xu_li_2010())
    fit = pt.identify(
        quick(), "dahl", parameters={**step.parameters, **BOX}, method=replace(SMALL, seed=1)
    )
    for name, value in step.hysteresis.items():
        assert getattr(fit.model, name) == value
        assert not fit.parameters[name].free
    assert not fit.scale_assumed
    same = pt.identify(
        quick(), "dahl", parameters={**BOX, **step.hysteresis}, method=replace(SMALL, seed=1)
    )
    assert same.model == fit.model
    assert same.cost == fit.cost


def test_what_is_said_of_a_parameter_goes_before_the_step() -> None:
    step = pt.identify_step(pt.identification.StepReadings.xu_li_2010())
    fit = pt.identify(
        quick(),
        "dahl",
        parameters={**step.parameters, **BOX, "a2": (1e6, 2e6), "a1": 100.0},
        method=SMALL,
    )
    assert fit.model.a1 == 100.0
    assert fit.parameters["a2"].free
    assert fit.model.b1 == step.hysteresis["b1"]
    parameters: dict[str, Any] = {**step.parameters, **BOX, "a1": pt.Parameter()}
    freed = pt.identify(quick(), "dahl", parameters=parameters, method=SMALL)
    assert freed.parameters["a1"].free
    assert not freed.parameters["a2"].free


def test_the_papers_way_from_a_step_to_a_fit() -> None:
    # The step's parameters, then four searched in the paper's box.
    step = pt.identify_step(pt.identification.StepReadings.xu_li_2010())
    fit = pt.identify(
        quick(), "dahl", parameters={**step.parameters, **BOX}, method=pt.Descents(seed=1)
    )
    assert fit.cost_percent < 0.1
    assert fit.model.stiffness == pytest.approx(TABLE_1.stiffness, rel=0.01)


# What is printed and drawn.


def test_the_summary_says_what_is_known() -> None:
    text = pt.identify_step(pt.identification.StepReadings.xu_li_2010()).summary()
    for piece in ("readings entered by hand", "117.7622", "192.5302, 170.2524", "um/V", "121.9874"):
        assert piece in text
    assert "One step does not determine K, T, M and D" in text
    known = pt.identify_step(step_log(1), stiffness=26065.0).summary()
    for piece in ("step.csv", "with the stiffness given", "26065  N/m", "by the logarithmic"):
        assert piece in known
    assert max(map(len, known.splitlines())) < 170


def test_the_picture_has_peaks_and_units() -> None:
    import matplotlib.pyplot as plt

    step = pt.identify_step(step_log(1))
    figure = step.plot()
    left, right = figure.axes
    assert left.get_xlabel() == "time after the step [ms]"
    assert left.get_ylabel() == "displacement [\N{MICRO SIGN}m]"
    assert right.get_xlabel() == "frequency [Hz]"
    assert right.get_ylabel() == "gain [\N{MICRO SIGN}m/V]"
    marks = next(line for line in left.lines if line.get_label() == "overshoot peaks")
    assert list(np.asarray(marks.get_ydata())) == [1e6 * peak for peak in step.readings.peaks]
    plt.close(figure)
    with pytest.raises(pt.ParameterError, match="entered by hand"):
        pt.identify_step(pt.identification.StepReadings.xu_li_2010()).plot()


# The command.


def test_what_is_saved_is_the_document_and_a_picture_where_there_is_a_record(
    tmp_path: Path,
) -> None:
    step = pt.identify_step(step_log(1))
    written = step.save(tmp_path / "record")
    assert [path.name for path in written] == ["step.json", "step.png", "step.svg"]
    saved = json.loads(written[0].read_text())
    assert saved == json.loads(json.dumps(step.document()))
    assert saved["readings"]["frequency"] == step.readings.frequency
    by_hand = pt.identify_step(step.readings).save(tmp_path / "by hand")
    assert [path.name for path in by_hand] == ["step.json"]


def test_the_command(tmp_path: Path) -> None:
    log = step_log(1)
    file = tmp_path / "step.csv"
    write_columns(file, {"time_s": log.t, "voltage_V": log.u, "displacement_um": 1e6 * log.y})
    runner = CliRunner()
    out = str(tmp_path / "results")
    done = runner.invoke(app, ["step", str(file), "--out", out, "--fix", "stiffness=26065", "-v"])
    assert (done.exit_code, done.stderr) == (0, "")
    step = pt.identify_step(pt.read(file, hold="zoh"), stiffness=26065.0)
    assert done.stdout.startswith(step.summary())
    assert f"--fix a1={step.hysteresis['a1']:.8g}" in done.stdout
    assert {path.name for path in Path(out).iterdir()} == {"step.json", "step.png", "step.svg"}
    document = json.loads(Path(out, "step.json").read_text(encoding="utf-8"))
    assert document["hysteresis"] == step.hysteresis
    assert document["damping_ratio"] == step.damping_ratio
    level = runner.invoke(
        app, ["step", str(file), "--out", out, "--overwrite", "--second-level", "37.5V:61um"]
    )
    assert level.exit_code == 0
    assert "with a second static level" in level.stdout
    late = runner.invoke(app, ["step", str(file), "--out", out, "--overwrite", "--window", "0.1:"])
    assert late.exit_code == 2
    assert "step.csv: there is no step in the drive" in late.stderr
    for bad in (["--window", "5"], ["--second-level", "37"]):
        refused = runner.invoke(app, ["step", str(file), "--out", out, *bad])
        assert refused.exit_code == 2
        assert refused.stderr.startswith("piezotrack: ")
