"""The benchmark of models: records, contenders, scores, and what is kept of them."""

from __future__ import annotations

import importlib
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import distributions
import piezotrack as pt
from piezotrack.benchmarking.contenders import contenders_named, listed_contenders
from piezotrack.benchmarking.discrete_backlash import identify_backlash, last_cycle
from piezotrack.benchmarking.plain_models import contender_of
from piezotrack.benchmarking.records import RECORDS, made_up, records_named
from piezotrack.benchmarking.records.bouc_wen_benchmark import multisine
from piezotrack.benchmarking.scoring import result_of
from piezotrack.data import datasets
from piezotrack.errors import DataError, ParameterError

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

DT = 0.005


def ramp_log(offset: float = 0.0) -> pt.Dataset:
    """A stage without hysteresis: 4 um/V."""
    u = 5.0 * np.sin(np.arange(4000) / 100.0)
    return pt.Dataset(u=u, y=4e-6 * u + offset, dt=DT)


def record(**more: Any) -> pt.BenchmarkRecord:
    log = ramp_log()
    return pt.BenchmarkRecord(
        name="line",
        fitted=log[2.0:10.0],
        rest=log[10.0:],
        others={"other log": ramp_log(3e-6)},
        **more,
    )


# The authors' own method.


def test_the_discrete_backlash_has_the_numbers_that_its_authors_publish() -> None:
    # DBO_Para/K.dat, y0.dat, H.dat and S.dat of github.com/yan9a/DiscreteBacklashOperator at
    # 127a816 (MIT licence): from one cycle that begins at row 3152 of their file, less its mean.
    log = datasets.dbo_training()
    u, y = log.u[3151:3351], log.y[3151:3351]
    model = identify_backlash(u, y - y.mean())
    assert 1e6 * model.slope == pytest.approx(12.533528611111112, rel=1e-12)
    assert 1e6 * model.level == pytest.approx(-22.97262248, rel=1e-9)
    assert model.backlash.dx.size == model.curve.dx.size == 25
    published = {
        "backlash": (
            (0.40876798071954590, 0.19817724673518211, 0.23681931654124289, 0.022994274325124575),
            (0.20406781579819550, 0.15915719295738961, 0.16892966707026219, 0.095854855186075838),
        ),
        "curve": (
            (0.30244219265823014, 0.17521437763454933, 0.19501051321924495, 0.064383571034450693),
            (0.31039360385951126, 0.18212006205802245, 0.21073847039226018, 0.054465558476749720),
        ),
    }
    for name, (dx, dy) in published.items():
        pieces = getattr(model, name)
        # Theirs come from a search that stops at a tolerance.
        assert pieces.dx[[0, 1, 2, -1]] == pytest.approx(dx, rel=2e-6)
        assert pieces.dy[[0, 1, 2, -1]] == pytest.approx(dy, rel=2e-6)


def test_its_inverse_asks_for_the_drive_that_its_authors_recorded() -> None:
    log, tracked = datasets.dbo_training(), datasets.dbo_tracking()
    u, y = log.u[3151:3351], log.y[3151:3351]
    model = identify_backlash(u, y - y.mean())
    reference = tracked.columns["reference"]
    # From row 7432 on the drive is theirs; another model than that of the recording day.
    part = slice(7632, None)
    error = model.inverse(reference)[part] - tracked.u[part]
    assert np.std(error) < 0.004 * np.ptp(tracked.u[part])
    # What they report, 1.68 and 0.58 um, is in the log: 1000 samples from rows 5052 and 11152 on,
    # the sensor a sample late, as in their program.
    for first, reported in ((5051, 1.68), (11151, 0.58)):
        seen = tracked.y[first + 1 : first + 1001]
        left = reference[first : first + 1000] - (seen - seen.mean())
        assert 1e6 * np.sqrt(np.mean(left**2)) == pytest.approx(reported, abs=0.005)


def test_the_discrete_backlash_and_its_inverse_undo_each_other() -> None:
    log = datasets.dbo_training()
    model = identify_backlash(*last_cycle(log.u[600:4600], log.y[600:4600]))
    t = np.arange(3000) / 200.0
    u = 1.8 + (1.6 - 0.08 * t) * np.sin(2.0 * np.pi * t)
    # But for what is snapped to a corner, a tenth of the last piece.
    away = model.inverse(model.simulate(u)) - u
    assert np.std(away) < 0.005 * np.ptp(u)


def test_a_drive_without_cycles_has_no_last_one() -> None:
    u = np.random.default_rng(1).standard_normal(4000)
    with pytest.raises(DataError, match="the drive does not repeat"):
        last_cycle(u, u)


def test_a_loop_of_noise_has_no_discrete_backlash() -> None:
    t = np.arange(2000) / 200.0
    u = 1.0 - np.cos(2.0 * np.pi * t)
    noise = np.random.default_rng(1).standard_normal(t.size)
    with pytest.raises(DataError, match="does not have 25 pieces that rise"):
        identify_backlash(*last_cycle(u, noise))


# What a person writes in a quarter of an hour.


def test_fifteen_lines_have_the_figures_of_other_people_s_runs() -> None:
    # 0.715 % where fitted and 0.572 % on the other log, with the data's README as the rule.
    result = pt.benchmark(["measured"], ["plays-nnls"]).results[0]
    assert [part.part for part in result.parts] == ["fitted", "rest", "other log"]
    assert result.parts[0].rms_percent == pytest.approx(0.715, abs=0.0006)
    assert result.parts[2].rms_percent == pytest.approx(0.572, abs=0.002)


# Records.


@pytest.mark.slow
def test_the_bouc_wen_benchmark_has_the_published_signals() -> None:
    record = RECORDS["bouc-wen-benchmark"]()
    u = multisine(3)
    assert u.size == 8192 * 20
    assert np.sqrt(np.mean(u**2)) == pytest.approx(50.0, rel=1e-12)
    lines = np.abs(np.fft.rfft(u))
    frequency = np.fft.rfftfreq(u.size, 1.0 / 15000.0)
    inside = (frequency >= 5.0) & (frequency <= 150.0)
    assert lines[inside].min() == pytest.approx(lines[inside].max(), rel=1e-9)
    assert lines[~inside].max() < 1e-9 * lines[inside].max()
    sizes = {part: data.full.u[::4].size for part, data in record.parts()}
    assert sizes == {"fitted": 2 * 8192, "multisine": 2 * 8192, "sine sweep": 153000}
    sweep = record.others["sine sweep"]
    assert (sweep.drive_unit, sweep.dt) == ("N", 1.0 / 3000.0)
    assert np.abs(sweep.u).max() == pytest.approx(40.0, rel=1e-3)
    # 10 Hz a minute: so many turns from its beginning on.
    turns = np.count_nonzero(np.diff(np.sign(sweep.u)) != 0)
    assert turns == pytest.approx(2.0 * (18.0 * 204.0 + 204.0**2 / 12.0), abs=2)
    # Table 1 of Noel and Schoukens 2016; beta is held at 1.
    assert record.truth == pytest.approx(
        {
            **{"mass": 2.0, "damping": 10.0, "stiffness": 5e4, "alpha": 5e4},
            **{"gamma": 800.0, "delta": -1100.0},
        }
    )


def test_rate_dependent_plays_follow_their_equations(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(2)
    u = 50.0 + np.cumsum(rng.standard_normal(400))
    dt = 0.01
    x = np.zeros(u.size)
    for r0, weight in zip(made_up.THRESHOLDS, made_up.WEIGHTS, strict=True):
        z = 0.0
        for k in range(u.size):
            before, after = u[max(k - 1, 0)], u[min(k + 1, u.size - 1)]
            span = dt * (min(k + 1, u.size - 1) - max(k - 1, 0))
            r = r0 + 2e-3 * abs(after - before) / span
            z = max(u[k] - r, min(u[k] + r, z))
            x[k] += weight * z
    x += 0.3e-6 * u
    assert np.abs(made_up.rate_dependent_plays(u, dt) - x).max() < 1e-18
    # Without rate they are the plays of Prandtl and Ishlinskii.
    monkeypatch.setattr(made_up, "RATE", 0.0)
    plays = pt.PrandtlIshlinskiiStage(
        linear=0.3e-6,
        thresholds=tuple(made_up.THRESHOLDS),
        weights=tuple(made_up.WEIGHTS),
    )
    assert np.abs(made_up.rate_dependent_plays(u, dt) - plays.simulate(u, dt).x).max() < 1e-15


@pytest.mark.parametrize("name", ["creep", "mode", "asymmetry", "rate-1hz", "rate-three"])
def test_a_made_up_record_has_its_noise_and_begins_at_rest(name: str) -> None:
    made = RECORDS[name]()
    assert made.noise == 20e-9
    assert made.fitted.u[0] == 0.0
    assert 30e-6 < made.fitted.stroke < 50e-6
    assert made.rest is not None
    # Nothing of the rest is in the part that is fitted.
    assert made.fitted.t[-1] < made.rest.t[0]
    assert made.fitted.warmup == 0


def test_one_record_of_three_rates_tells_the_rate() -> None:
    """Plays that know the rate are at the noise at each one, others are off at the fast one."""
    (entry,) = records_named(["rate-three"])
    assert list(entry.others) == ["at 0.1 Hz", "at 1 Hz", "at 10 Hz"]
    assert [round(1.0 / (200 * log.dt), 6) for log in entry.others.values()] == [0.1, 1.0, 10.0]
    # One cycle of the slowest, four and 24 of the others.
    assert entry.fitted.duration == pytest.approx(10.0 + 4.0 + 2.4)
    for model, limits in (
        ("rate-dependent-prandtl-ishlinskii", [0.0, 1.25]),
        ("prandtl-ishlinskii", [3.0, 6.0]),
    ):
        fit = pt.identify(entry.fitted, model)
        errors = [fit.score(log).rms for log in entry.others.values()]
        assert limits[0] < errors[2] / 20e-9 < limits[1], model
        assert max(errors[:2]) < 2.0 * 20e-9, model


def test_the_package_finds_asymmetry_to_the_noise() -> None:
    found = pt.benchmark(["asymmetry"], ["prandtl-ishlinskii"]).results[0]
    assert [part.rms < 1.15 * 20e-9 for part in found.parts] == [True] * 3


@pytest.mark.slow
def test_the_package_finds_the_bouc_wen_benchmark_from_noisy_data() -> None:
    result = pt.benchmark(["bouc-wen-benchmark"], ["bouc-wen-oscillator"]).results[0]
    fitted, multisine_error, sweep_error = (part.rms for part in result.parts)
    assert fitted == pytest.approx(7e-6, rel=0.03)
    assert multisine_error < 1e-6
    assert sweep_error < 1e-6
    assert result.parameters.keys() == {"mass", "damping", "stiffness", "alpha", "gamma", "delta"}
    assert all(abs(one["percent"]) < 1.0 for one in result.parameters.values())


# Scores.


def test_a_model_is_scored_with_one_offset_on_a_record_and_another_on_another() -> None:
    def known(u: Array, dt: float) -> Array:
        return 4e-6 * u + 7e-6 + 1e-9 * np.arange(u.size) * dt

    result = result_of(contender_of("known", "known", known), record())
    fitted, rest, other = result["parts"]
    # A drift of 1 nm/s: over 8 s, and from the middle of that to the rest at 10 to 20 s.
    assert fitted["rms_m"] == pytest.approx(8e-9 / np.sqrt(12.0), rel=1e-3)
    assert rest["rms_m"] == pytest.approx(np.hypot(9e-9, 10e-9 / np.sqrt(12.0)), rel=1e-3)
    assert other["rms_m"] == pytest.approx(20e-9 / np.sqrt(12.0), rel=1e-3)
    assert result["values"] is None
    assert result["inverse"]["error"] == "it has no inverse"
    # Without offsets of their own nothing is taken off.
    strict = result_of(contender_of("known", "known", known), record(own_offsets=False))
    assert strict["parts"][0]["rms_m"] == pytest.approx(7e-6, rel=1e-2)
    assert strict["parts"][2]["rms_m"] == pytest.approx(4e-6, rel=1e-2)


def test_an_inverse_is_scored_in_volts_and_by_what_the_model_makes_of_it() -> None:
    def fit(u: Array, y: Array, _: float) -> Any:
        slope = np.ptp(y) / np.ptp(u)

        def predict(u: Array, _: float) -> Array:
            return slope * u

        predict.values = 1  # type: ignore[attr-defined]
        # An inverse with a gain that is 1 % too high.
        predict.inverse = lambda x, _: 1.01 * x / slope  # type: ignore[attr-defined]
        return predict

    result = result_of(contender_of("line", "line", fit), record())
    inverse = result["inverse"]
    assert inverse["part"] == "other log"
    assert result["values"] == 1
    spread = np.std(ramp_log().u)
    assert inverse["drive_rms"] == pytest.approx(0.01 * spread, rel=1e-2)
    assert inverse["drive_percent"] == pytest.approx(0.1 * spread, rel=1e-2)
    assert inverse["identity_rms_m"] == pytest.approx(4e-8 * spread, rel=1e-2)


def test_a_model_that_does_not_suit_is_a_result_with_a_sentence() -> None:
    board = pt.benchmark(["asymmetry"], ["discrete-backlash", "plays-nnls"])
    failed, fitted = board.results
    assert failed.error is not None
    assert "the drive does not repeat" in failed.error
    assert failed.judged is None
    # The best comes first, and what has no figures last.
    assert [one.model for one in board.of("asymmetry")] == ["plays-nnls", "discrete-backlash"]
    assert fitted.judged is not None
    assert "no fit: discrete backlash (2018): the drive does not repeat" in board.summary()
    assert "No fit: discrete backlash" in board.markdown()


# What is kept.


def test_results_are_kept_until_the_record_changes(tmp_path: Path) -> None:
    def run(one: pt.BenchmarkRecord, **more: Any) -> Any:
        return pt.benchmark([one], ["plays-nnls"], folder=tmp_path, **more).results[0]

    first = run(record())
    file = tmp_path / "results" / "line--plays-nnls.json"
    document = json.loads(file.read_text(encoding="utf-8"))
    assert document["format"] == "piezotrack-benchmark-result"
    assert document["parts"][0]["rms_m"] == first.parts[0].rms
    # A mark in the file tells whether it was computed again.
    file.write_text(json.dumps({**document, "seconds": 123.0}), encoding="utf-8")
    assert run(record()).seconds == 123.0
    assert run(record(), overwrite=True).seconds < 100.0
    file.write_text(json.dumps({**document, "seconds": 123.0}), encoding="utf-8")
    assert run(record(own_offsets=False)).seconds < 100.0
    file.write_text("{", encoding="utf-8")
    assert run(record()).seconds < 100.0


def test_a_board_is_written_whole(tmp_path: Path) -> None:
    board = pt.benchmark([record(noise=1e-9)], ["plays-nnls", "first-order-dahl"])
    assert max(map(len, board.summary().splitlines())) <= 100
    written = {path.name for path in board.save(tmp_path)}
    names = {"benchmark.md", "benchmark.json", "benchmark.png", "benchmark.svg"}
    assert written == names == {path.name for path in tmp_path.iterdir()}
    document = json.loads((tmp_path / "benchmark.json").read_text(encoding="utf-8"))
    assert document["format"] == "piezotrack-benchmark"
    assert [one["model"] for one in document["results"]] == ["plays-nnls", "first-order-dahl"]
    assert "| model | fitted | rest | other log | K |" in board.markdown()


# Other people's models.


def install(folder: Path, code: str, *, name: str = "gain", module: str = "their_models") -> None:
    """Put a distribution with one model into a folder."""
    distributions.install(
        folder, code, group="piezotrack.models", name=name, module=module, function="fit"
    )


GAIN = """\
import numpy as np


def fit(u, y, dt):
    gain, offset = np.polyfit(u, y, 1)
    return lambda u, dt: gain * u + offset
"""


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(__import__("sys").modules, "their_models", raising=False)
    importlib.invalidate_caches()
    return tmp_path


def test_an_installed_model_takes_part(site: Path) -> None:
    install(site, GAIN)
    assert "gain" in listed_contenders()
    found = pt.benchmark([record()], ["gain"]).results[0]
    assert found.title == "gain (their_models)"
    assert all(part.rms < 1e-15 for part in found.parts)


def test_an_installed_model_does_not_take_the_name_of_another(site: Path) -> None:
    install(site, GAIN, name="dahl")
    listed = listed_contenders()
    assert listed["dahl"].title == "Dahl, second order"
    assert listed["their_models-dahl"].title == "dahl (their_models)"


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("fit = 3", "no function: expected fit"),
        ("def fit(u): return u", "a function of 1 arguments"),
        ("import nothing_of_this_name", "cannot be loaded: ModuleNotFoundError"),
        ("def fit(u, y, dt): return 3", "returned 3: expected a function predict"),
        ("def fit(u, y, dt): raise ValueError('no')", "gain failed: ValueError: no"),
        ("def fit(u, dt): return u[:-1]", "array of shape"),
        ("def fit(u, dt): return u * float('nan')", "not finite numbers"),
        ("def fit(u, y, dt): return {}[1]", "gain failed: KeyError"),
        ("def fit(u, dt): return u.missing", "gain failed: AttributeError"),
        ("def fit(u, dt): return ['x'] * len(u)", "gain failed: ValueError"),
    ],
)
def test_an_installed_model_that_does_not_conform_is_a_sentence(
    site: Path, code: str, words: str
) -> None:
    install(site, code)
    result = pt.benchmark([record()], ["gain"]).results[0]
    assert result.error is not None
    assert words in result.error
    assert not result.parts


# Refusals.


def test_names_that_are_none_are_refused() -> None:
    with pytest.raises(ParameterError, match="models has 'dal': expected some of 'auto', 'dahl'"):
        contenders_named(["dal"])
    with pytest.raises(ParameterError, match="models is empty"):
        contenders_named([])
    with pytest.raises(ParameterError, match="records has 'none': expected some of 'measured'"):
        records_named(["none"])
    with pytest.raises(ParameterError, match="records is empty"):
        records_named([])
    with pytest.raises(ParameterError, match="records has line twice"):
        records_named([record(), record()])
    with pytest.raises(ParameterError, match="overwrite is True without a folder"):
        pt.benchmark([record()], ["plays-nnls"], overwrite=True)
    with pytest.raises(ParameterError, match="record is 'none': expected one of 'line'"):
        pt.benchmark([record()], ["plays-nnls"]).of("none")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"name": "a/b"}, "name is 'a/b': expected up to 80 small letters"),
        ({"others": [ramp_log()]}, "others is"),
        ({"rest": 3}, "rest is 3: expected a Dataset"),
        ({"noise": 0.0}, "noise is 0"),
        (
            {"rest": pt.Dataset(u=ramp_log().u, y=ramp_log().y, dt=DT, drive_unit="N")},
            "rest has a drive in N: expected V",
        ),
    ],
)
def test_a_record_that_cannot_be_one_is_refused(arguments: dict[str, Any], words: str) -> None:
    given: dict[str, Any] = {"name": "line", "fitted": ramp_log(), **arguments}
    with pytest.raises(ParameterError, match=words):
        pt.BenchmarkRecord(**given)


def test_a_record_of_a_log_has_the_parts_of_a_comparison() -> None:
    log, other = ramp_log(), ramp_log(3e-6)
    halves = pt.BenchmarkRecord.of_log(log)
    assert (halves.name, halves.fitted.duration) == ("log", 10.0)
    assert halves.rest is not None
    assert halves.rest.duration == 10.0
    assert not halves.others
    whole = pt.BenchmarkRecord.of_log(log, other=other)
    assert (len(whole.fitted), whole.rest) == (4000, None)
    assert list(whole.others) == ["other log"]
    part = pt.BenchmarkRecord.of_log(log, train=(3.0, 9.0), other=other)
    assert part.rest is not None
    assert (part.fitted.duration, part.rest.duration) == (6.0, 11.0)
