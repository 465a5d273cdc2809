"""What `pt.data.info` finds in a log, and what it says that the log can determine."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from piezotrack.data.checks.drive_features import time_features

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.floating[Any]]

DT = 0.001
NOISE = 10e-9


def written(folder: Path, u: Array, *, t: Array | None = None, noise: float = NOISE) -> Path:
    """Write the log of a stage of 1 um/V."""
    path = folder / "log.npz"
    y = 1e-6 * u + noise * np.random.default_rng(1).standard_normal(u.size)
    np.savez(path, time_s=DT * np.arange(u.size) if t is None else t, voltage_V=u, x_m=y)
    return path


def sine(frequency: float, cycles: float, amplitude: float = 30.0) -> Array:
    t = DT * np.arange(round(cycles / frequency / DT), dtype=np.float64)
    u: Array = amplitude * (1.0 - np.cos(2.0 * np.pi * frequency * t))
    return u


def determined(report: pt.data.LogInfo) -> str:
    return "\n".join(map(str, report.determines))


def test_a_sine_of_one_amplitude_and_rate(tmp_path: Path) -> None:
    report = pt.data.info(written(tmp_path, sine(1.0, 5.0)))
    assert report.problem == ""
    assert report.roles == {"time": "time_s", "drive": "voltage_V", "displacement": "x_m"}
    assert report.time is not None
    assert report.drive is not None
    assert report.time.interval == pytest.approx(DT)
    assert report.time.gaps == ()
    assert report.time.jitter < 1e-12
    # Five periods: up and down nine times between the ends.
    assert report.drive.turns == 9
    assert [count for _, count in report.drive.levels] == [4, 5]
    assert [level for level, _ in report.drive.levels] == pytest.approx([0.0, 60.0], abs=1e-9)
    assert report.drive.frequencies == pytest.approx((1.0, 1.0), rel=0.01)
    assert report.drive.rests == ()
    assert not report.drive.steps
    text = determined(report)
    assert "the loop between 0 V and 60 V: any model of hysteresis" in text
    assert "one amplitude, 60 V: minor loops" in text
    assert "one rate, 1 Hz: lag, delay, creep and hysteresis cannot be distinguished" in text
    assert "no rests after the first motion" in text
    # (f/fn)^2 of 30 um is three times the noise.
    limit = np.sqrt(30e-6 / (3 * NOISE))
    assert report.drive.mode_limit == pytest.approx(limit, rel=0.1)


def test_without_a_reversal_there_is_no_hysteresis(tmp_path: Path) -> None:
    text = determined(pt.data.info(written(tmp_path, np.linspace(0.0, 10.0, 500))))
    assert "no reversal: no hysteresis; the gain only" in text
    assert "too slow for a mode" in text
    up = pt.data.info(written(tmp_path, np.repeat([0.0, 10.0], [200, 800])))
    assert (
        "no reversal: no hysteresis; gain, lag and mode from the step (piezotrack step)"
        in determined(up)
    )
    assert "steps: a mode up to 450 Hz, 0.45 of the sampling rate" in determined(up)
    one = determined(pt.data.info(written(tmp_path, sine(1.0, 1.0))))
    assert "one reversal: the loop is not closed" in one


def test_a_rest_before_the_first_motion_tells_nothing_of_creep(tmp_path: Path) -> None:
    before = pt.data.info(written(tmp_path, np.r_[np.zeros(3000), sine(1.0, 3.0)]))
    assert before.drive is not None
    (rest,) = before.drive.rests
    assert rest == pytest.approx((0.0, 3.0, 0.0), abs=0.15)
    assert "no rests" in determined(before)
    after = pt.data.info(written(tmp_path, np.r_[sine(1.0, 2.5), np.full(8000, 60.0)]))
    assert after.drive is not None
    (rest,) = after.drive.rests
    assert rest == pytest.approx((2.5, 10.5, 60.0), abs=0.15)
    assert "rests for up to 8" in determined(after)


def test_a_staircase_rests_at_each_step(tmp_path: Path) -> None:
    levels = np.array([0.0, 20.0, 40.0, 60.0, 40.0, 20.0, 0.0, 20.0])
    report = pt.data.info(written(tmp_path, np.repeat(levels, 1000)))
    assert report.drive is not None
    assert [level for _, _, level in report.drive.rests] == levels.tolist()
    assert [stop - start for start, stop, _ in report.drive.rests] == pytest.approx([0.999] * 8)


def test_several_amplitudes_and_rates(tmp_path: Path) -> None:
    ramp = np.concatenate([sine(1.0, 1.0, size) + 30.0 - size for size in (30.0, 20.0, 10.0, 5.0)])
    text = determined(pt.data.info(written(tmp_path, ramp)))
    assert "smaller loops too, models of plays (prandtl-ishlinskii) in full" in text
    assert "one rate, 1 Hz" in text
    rates = np.concatenate([sine(1.0, 2.0), sine(20.0, 6.0)])
    text = determined(pt.data.info(written(tmp_path, rates)))
    assert re.search(r"rates from 1 Hz to 2\d(\.\d)? Hz: lag and delay can be", text)
    near = np.concatenate([sine(1.0, 2.0), sine(4.0, 4.0)])
    assert "a lag can partly be" in determined(pt.data.info(written(tmp_path, near)))


def test_gaps_are_counted_in_missing_samples(tmp_path: Path) -> None:
    t, u = DT * np.arange(3000), sine(1.0, 3.0)
    keep = np.ones(3000, dtype=bool)
    keep[500:520] = keep[2000:2001] = False
    report = pt.data.info(written(tmp_path, u[keep], t=t[keep]))
    assert report.time is not None
    assert [count for _, _, count in report.time.gaps] == [20, 1]
    assert report.time.gaps[0][:2] == pytest.approx((0.499, 0.52))
    assert "2, 21 samples missing: 0.499 to 0.52 s" in report.summary()
    assert "t is not even" in report.problem
    assert "read it with resample=" in determined(report)


def test_jitter_is_measured(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    jitter = 0.05 * DT
    t = DT * np.arange(3000) + jitter * rng.uniform(-1.0, 1.0, 3000)
    report = pt.data.info(written(tmp_path, sine(1.0, 3.0), t=t))
    assert report.time is not None
    # The difference of two uniform errors.
    assert report.time.jitter == pytest.approx(jitter * np.sqrt(2.0 / 3.0), rel=0.1)


def test_times_that_go_back_are_counted(tmp_path: Path) -> None:
    t = DT * np.arange(3000)
    t[100] = t[99]
    report = pt.data.info(written(tmp_path, sine(1.0, 3.0), t=t))
    assert report.time is not None
    assert report.time.backward == 1
    assert "the time does not increase at 1 samples" in determined(report)


def test_a_log_that_is_not_read_is_described_as_far_as_it_goes(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    u = sine(1.0, 3.0)
    np.savez(path, time_s=DT * np.arange(3000), voltage=u, x_um=u, slow=np.arange(7.0))
    report = pt.data.info(path)
    assert report.problem.startswith("column 'voltage' has no unit")
    assert report.drive is None
    assert report.stroke == pytest.approx(60e-6)
    assert [(one.title, one.unit, one.samples) for one in report.columns] == [
        ("time_s", "s", 3000),
        ("voltage", "", 3000),
        ("x_um", "um", 3000),
        ("slow", "", 7),
    ]
    assert (report.columns[3].low, report.columns[3].high) == (0.0, 6.0)
    given = pt.data.info(path, units={"voltage": "V"})
    assert given.problem == ""
    assert given.drive is not None
    with pytest.raises(pt.ParameterError, match="'volts' is not a column"):
        pt.data.info(path, drive="volts")


@pytest.mark.parametrize("columns", ["time_s,x_um", "time_s,u_V"])
def test_a_log_of_one_signal(tmp_path: Path, columns: str) -> None:
    path = tmp_path / "log.csv"
    rows = "\n".join(f"{k / 100},{k % 7}" for k in range(100))
    path.write_text(f"{columns}\n{rows}\n", encoding="utf-8")
    report = pt.data.info(path)
    expected = "no drive: the noise of a sensor" if "x" in columns else "no displacement: a drive"
    assert expected in determined(report)
    assert "no column is known to be the" in report.problem


def test_what_never_changes_is_said(tmp_path: Path) -> None:
    text = determined(pt.data.info(written(tmp_path, np.full(500, 5.0))))
    assert "the drive stands at 5 V: no model of the stage; the noise of the sensor" in text
    path = tmp_path / "dead.npz"
    np.savez(path, time_s=DT * np.arange(3000), voltage_V=sine(1.0, 3.0), x_um=np.ones(3000))
    assert "the displacement never changes" in determined(pt.data.info(path))


def test_entries_that_are_no_numbers_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    lines = ["time_s,voltage_V,x_um,state"]
    lines += [f"{k / 100},{k % 5},{'lost' if k == 7 else k % 5},on" for k in range(50)]
    path.write_text("\n".join(lines), encoding="utf-8")
    report = pt.data.info(path)
    assert [column.missing for column in report.columns] == [0, 0, 1, 50]
    assert "'lost' in column 'x_um' is not a number" in report.problem
    assert "1 not finite" in report.summary()


def test_the_document_has_what_the_words_have(tmp_path: Path) -> None:
    report = pt.data.info(written(tmp_path, sine(1.0, 5.0)))
    document: dict[str, Any] = report.document()
    assert document["drive"]["turns"] == 9
    assert document["columns"][1]["unit"] == "V"
    assert document["problem"] is None
    assert document["determines"] == list(map(str, report.determines))


def test_the_measured_log_says_what_it_is() -> None:
    import tempfile
    from pathlib import Path

    with tempfile.TemporaryDirectory() as folder:
        path = pt.datasets.dbo_training().save(Path(folder, "log.npz"))
        report = pt.data.info(path)
    assert report.drive is not None
    # About 40 periods of 1 Hz, 0 to 3.6 V, at 200 Hz.
    assert 79 <= report.drive.turns <= 81
    assert (report.drive.low, report.drive.high) == (0.0, 3.6)
    assert "one rate, 1 Hz" in determined(report)
    assert "one amplitude, 3.6 V" in determined(report)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("column", ["time_s", "voltage_V", "x_m"])
@pytest.mark.parametrize("sample", [0, 7])
@pytest.mark.parametrize("value", [-1e308, 1e200, 1e305])
def test_a_sample_beyond_sense_is_a_problem_of_its_column(
    tmp_path: Path, column: str, sample: int, value: float
) -> None:
    path = written(tmp_path, sine(1.0, 2.0))
    with np.load(path) as file:
        columns = {name: file[name].copy() for name in file}
    columns[column][sample] = value
    np.savez(path, **columns)
    report = pt.data.info(path)
    assert column in report.problem
    assert "sample" in report.problem
    assert report.drive is None
    assert report.summary()
    with pytest.raises(pt.DataError, match=column) as caught:
        pt.read(path)
    assert str(caught.value).startswith("log.npz: ")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("step", [5e-324, 1e-300])
def test_times_that_hardly_differ_are_described(tmp_path: Path, step: float) -> None:
    u = sine(1.0, 1.0)
    times = step * np.arange(u.size)
    times[500:] += 1.0
    report = pt.data.info(written(tmp_path, u, t=times))
    assert report.problem
    assert report.time is not None
    assert report.time.gaps != ()


@pytest.mark.filterwarnings("error")
def test_an_interval_beyond_sense_is_a_problem(tmp_path: Path) -> None:
    path = tmp_path / "log.npz"
    np.savez(path, voltage_V=sine(1.0, 1.0), x_m=sine(1.0, 1.0), dt_s=1e300)
    found = pt.data.info(path)
    assert "1e+300" in found.problem
    assert found.time is None


def test_a_log_sampled_far_above_its_drive_names_the_rate_that_is_enough(tmp_path: Path) -> None:
    t = np.arange(50_000) / 5000.0
    fast = pt.data.info(written(tmp_path, 150.0 * np.sin(2.0 * np.pi * t), t=t))
    (note,) = fast.notes
    assert note.startswith("5 kHz for a 1 Hz drive: 200 Hz are enough")
    # What is said loses nothing: a line between the samples that remain is the drive.
    factor = int(re.search(r"decimate\((\d+)\)", note)[1])  # type: ignore[index]
    log = pt.read(tmp_path / "log.npz")
    less = log.decimate(factor)
    assert np.abs(np.interp(log.t, less.t, less.u) - log.u)[:-factor].max() < 1e-3 * np.ptp(log.u)
    # Nothing is said of the lower rate, nor of one that the drive needs.
    assert pt.data.info(less.save(tmp_path / "less.npz")).notes == ()
    assert pt.data.info(written(tmp_path, 150.0 * np.sin(50.0 * np.pi * t), t=t)).notes == ()


@pytest.mark.parametrize("rise", [0.0, 0.004])
def test_nothing_is_said_of_the_rate_of_steps(tmp_path: Path, rise: float) -> None:
    t = np.arange(50_000) / 5000.0
    u = np.clip(((t % 2.0) - 0.5) / max(rise, 1e-9), 0.0, 1.0) * (t % 2.0 < 1.5)
    assert pt.data.info(written(tmp_path, 60.0 * u, t=t)).notes == ()


@pytest.mark.parametrize("frequency", [3.0, 40.0])
def test_the_fastest_part_of_a_drive_says_the_rate(frequency: float) -> None:
    from piezotrack.data.checks.sampling_rate import spare_factor

    t = np.arange(100_000) / 20_000.0
    burst = np.where(t > 4.5, 0.5 * np.sin(2.0 * np.pi * frequency * t), 0.0)
    noise = 1e-3 * np.random.default_rng(2).standard_normal(t.size)
    factor = spare_factor(np.sin(2.0 * np.pi * t) + burst + noise, 5e-5)
    samples = 20_000.0 / factor / frequency
    assert (factor == 1) if frequency == 40.0 else (100.0 < samples < 260.0)


def hysteresis(u: Array) -> Array:
    stage = pt.PrandtlIshlinskiiStage(linear=0.6e-6, thresholds=(5.0, 15.0), weights=(1e-7, 1e-7))
    y: Array = stage.simulate(u, DT).x
    return y + NOISE * np.random.default_rng(4).standard_normal(u.size)


def test_a_rest_after_the_motion_shows_creep_at_one_rate_too(tmp_path: Path) -> None:
    rested = determined(pt.data.info(written(tmp_path, np.r_[sine(1.0, 2.5), np.full(8000, 60.0)])))
    assert "creep with time constants up to that" in rested
    assert "creep and hysteresis cannot" not in rested
    assert "one rate, 1 Hz: lag, delay and hysteresis cannot be distinguished" in rested


def test_what_is_left_out_is_not_in_the_stroke(tmp_path: Path) -> None:
    u = sine(1.0, 5.0)
    y = hysteresis(u)
    y[2100] = 0.1
    found = pt.data.info(pt.Dataset(u=u, y=y, dt=DT).save(tmp_path / "log.npz"))
    assert found.stroke == pytest.approx(46e-6, rel=0.01)
    assert "left out as a single reading far off" in found.notes[0]


def test_no_model_where_the_displacement_does_not_follow(tmp_path: Path) -> None:
    u = sine(1.0, 20.0)
    y, noise = hysteresis(u), NOISE * np.random.default_rng(5).standard_normal(u.size)
    for drive, moved, note in (
        (1e6 * y, 1e-6 * u, "swapped"),
        (u, noise, "is the sensor connected?"),
    ):
        report = pt.data.info(pt.Dataset(u=drive, y=moved, dt=DT).save(tmp_path / "log.npz"))
        assert note in report.notes[0]
        assert determined(report).startswith("no model: drive")
        assert len(report.determines) == 1
    # A line up is followed, although it has no correlation but for its slope.
    ramp = np.linspace(0.0, 10.0, 5000)
    assert pt.data.info(written(tmp_path, ramp)).notes == ()


def test_the_lower_rate_is_not_called_enough_for_a_mode_above_it(tmp_path: Path) -> None:
    u = sine(1.0, 20.0)
    for noise, mode in ((0.0, True), (NOISE, False)):
        report = pt.data.info(written(tmp_path, u, noise=noise))
        assert ("mode up to 450 Hz" in determined(report)) == mode
        assert report.notes[0].startswith("1 kHz for a 1 Hz drive: 200 Hz are enough")
        assert report.notes[0].endswith("; not for a mode above 90 Hz") == mode


def test_the_rate_of_times_rounded_to_microseconds_is_that_of_the_log() -> None:
    t = np.round(np.arange(3000) / 6400.0, 6)
    assert 1.0 / time_features(t).interval == pytest.approx(6400.0, rel=1e-6)
    lost = np.delete(t, slice(1000, 1010))
    assert 1.0 / time_features(lost).interval == pytest.approx(6400.0, rel=1e-4)
