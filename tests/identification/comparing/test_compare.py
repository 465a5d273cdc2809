"""Models side by side: what is fitted, what is judged, and how it is told."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.patches import Rectangle

import piezotrack as pt
from commands import names, ran, refusal, run, without_progress
from folders import MEASURED
from piezotrack.data.log_file import write_log
from piezotrack.stages.registry import MODELS as LISTED
from play_records import fit_plays

TIMES = np.arange(1600) / 200.0
DRIVE = 37.5 - 25.0 * np.cos(np.pi * TIMES) - 12.0 * np.cos(1.5 * np.pi * TIMES)
# Some of the thresholds that a fit takes: elevenths of half the drive's range.
PLAYS = pt.PrandtlIshlinskiiStage(
    linear=0.9e-6,
    thresholds=tuple(np.ptp(DRIVE) / 22.0 * np.array([1.0, 3.0, 5.0, 8.0])),
    weights=(0.1e-6, 0.2e-6, 0.15e-6, 0.12e-6),
)
NOISE = 0.05e-6
PAIR = ["dahl", "prandtl-ishlinskii"]


@cache
def log(seed: int = 1, shift: float = 3e-6) -> pt.Dataset:
    """Play operators under two tones, 8 s at 200 Hz, with a noisy sensor."""
    noise = np.random.default_rng(seed).normal(0.0, NOISE, TIMES.size)
    y = PLAYS.simulate(DRIVE, 0.005).x + noise + shift
    return pt.Dataset(u=DRIVE, y=y, dt=0.005, source="plays.csv")


@cache
def comparison_of_pair() -> pt.identification.Comparison:
    return pt.compare(log(), PAIR, train=(1.0, 5.0), seed=1, runs=1)


def row(name: str, of: pt.identification.Comparison | None = None) -> pt.identification.ModelScore:
    return {one.name: one for one in (of or comparison_of_pair()).rows}[name]


# What is fitted and what is judged.


def test_a_model_is_what_identify_finds_on_the_fitted_part() -> None:
    compared_row = row("dahl")
    alone = pt.identify(log()[1.0:5.0], "dahl", method=pt.Descents(seed=1))
    assert compared_row.fit.document() == alone.document()
    # A search simulates with fewer sub-steps.
    assert compared_row.train.rms == pytest.approx(alone.cost, rel=1e-4)
    assert compared_row.title == "Dahl, second order"
    assert comparison_of_pair().fits == {one.name: one.fit for one in comparison_of_pair().rows}


def test_the_rest_is_simulated_through_with_state_and_offset_carried_on() -> None:
    for each in comparison_of_pair().rows:
        assert each.fit.start is not None
        begun = each.fit.start.state
        through = each.fit.model.simulate(log().u, 0.005, initial=begun).x + each.fit.offset
        error = (log().y - through)[1000:]
        assert len(comparison_of_pair().test) == 600
        assert each.test.rms == pytest.approx(float(np.sqrt(np.mean(error**2))), rel=1e-9)
        assert each.test.max_error == pytest.approx(float(np.abs(error).max()), rel=1e-9)
        assert each.test.offset == each.train.offset == each.fit.offset
        assert each.test.stroke == each.train.stroke == log()[1.0:5.0].stroke
    assert comparison_of_pair().carried
    # A restart would have forgotten what the plays remember.
    best = row("prandtl-ishlinskii").fit
    again = best.score(log().cut(5.0), offset=best.offset, history="virgin")
    assert again.rms > 5.0 * comparison_of_pair().best.test.rms


def test_what_the_record_is_made_of_is_best() -> None:
    assert comparison_of_pair().best.name == "prandtl-ishlinskii"
    # Nothing but the noise is left, where it was fitted and where not.
    assert comparison_of_pair().best.train.rms == pytest.approx(NOISE, rel=0.1)
    assert comparison_of_pair().best.test.rms == pytest.approx(NOISE, rel=0.15)
    assert row("dahl").test.rms > 2.5 * NOISE
    assert abs(comparison_of_pair().best.autocorrelation) < 0.15
    assert row("dahl").autocorrelation > 0.8


def test_the_criteria_are_burnham_and_andersons() -> None:
    data = comparison_of_pair().train
    for each in comparison_of_pair().rows:
        error = data.y - each.fit.simulate(data, offset=each.fit.offset).x
        n, rss = error.size, float(np.sum(error**2))
        # T, D, a1, a2, b1, as nothing excites a mode of some mass; w0, twenty weights,
        # two bends, no lag, as there is none; the offset each.
        free = 6 if each.name == "dahl" else 24
        assert each.parameters == free
        likelihood = n * np.log(rss / n)
        assert each.aic == pytest.approx(likelihood + 2 * (free + 1), rel=1e-12)
        assert each.bic == pytest.approx(likelihood + (free + 1) * np.log(n), rel=1e-12)
        from_mean = error - error.mean()
        lagged = float(from_mean[:-1] @ from_mean[1:]) / float(from_mean @ from_mean)
        assert each.autocorrelation == pytest.approx(lagged, rel=1e-9)


def windows(comparison: pt.identification.Comparison) -> list[tuple[float, float, int]]:
    parts = (comparison.train, comparison.test)
    return [(round(float(p.t[0]), 6), round(float(p.t[-1]), 6), p.warmup) for p in parts]


def test_windows_where_nothing_is_said() -> None:
    plays = ["prandtl-ishlinskii"]
    halves = pt.compare(log(), plays)
    assert windows(halves) == [(0.0, 3.995, 0), (4.0, 7.995, 800)]
    assert windows(pt.compare(log(), plays, train=(1.0, 3.0))) == [
        (1.0, 2.995, 200),
        (3.0, 7.995, 600),
    ]
    assert windows(pt.compare(log(), plays, test=(6.0, None))) == [
        (0.0, 5.995, 0),
        (6.0, 7.995, 1200),
    ]
    assert windows(pt.compare(log()[2.0:], plays)) == [(2.0, 4.995, 400), (5.0, 7.995, 1000)]
    before = pt.compare(log(), plays, train=(5.0, None), test=(1.0, 3.0))
    assert windows(before) == [(5.0, 7.995, 1000), (1.0, 2.995, 200)]


def test_another_record_has_an_offset_of_its_own() -> None:
    other = log(seed=2, shift=-7e-6)
    comparison = pt.compare(log(), ["prandtl-ishlinskii"], test=other[1.0:])
    first = comparison.rows[0]
    assert not comparison.carried
    assert comparison.train is log()
    assert first.test.offset == pytest.approx(-7e-6, abs=0.05e-6)
    assert first.train.offset == pytest.approx(3e-6, abs=0.05e-6)
    assert first.test.rms == pytest.approx(NOISE, rel=0.1)
    assert first.test.rms == first.fit.score(other[1.0:]).rms


def test_all_kinds_are_compared_where_none_is_named() -> None:
    comparison = pt.compare(log()[:4.0], seed=1, runs=1)
    # A voltage is no force: the oscillator is for records whose drive is in newtons.
    kinds = [info.name for info in LISTED if info.drive_unit == "V"]
    assert [one.name for one in comparison.rows] == kinds
    assert len(kinds) == len(LISTED) - 1


# Models that are there already.


def test_a_model_and_a_file_are_taken_as_they_are(tmp_path: Path) -> None:
    elsewhere = fit_plays(log()[2.0:6.0], dead_zones=False)
    file = elsewhere.save(tmp_path / "mine.json")
    comparison = pt.compare(log(), [file, elsewhere, str(file)], train=(1.0, 5.0))
    assert [one.name for one in comparison.rows] == ["mine", "prandtl-ishlinskii", "mine-2"]
    assert [one.title for one in comparison.rows] == [
        "Prandtl-Ishlinskii (mine)",
        "Prandtl-Ishlinskii",
        "Prandtl-Ishlinskii (mine-2)",
    ]
    for each in comparison.rows:
        assert each.fit.model == elsewhere.model
        # It was not fitted here: there is nothing to count, and the offset is this part's.
        assert (each.parameters, each.aic, each.bic) == (None, None, None)
        own = elsewhere.score(log()[1.0:5.0])
        assert (each.train.rms, each.train.offset) == (own.rms, own.offset)
    criteria = [line.split() for line in comparison.summary().splitlines() if " - " in line]
    assert [words[-4:-1] for words in criteria[:3]] == [["-", "-", "-"]] * 3
    assert comparison.rows[0].train.fit_percent > 90.0


def test_a_model_fitted_on_this_very_part_is_counted(tmp_path: Path) -> None:
    finer = fit_plays(log()[1.0:5.0], count=20, dead_zones=False, dynamics=None)
    file = finer.save(tmp_path / "finer.json")
    comparison = pt.compare(log(), [finer, file, "prandtl-ishlinskii"], train=(1.0, 5.0))
    assert [one.parameters for one in comparison.rows] == [22, 22, 24]
    assert comparison.rows[0].aic == comparison.rows[1].aic
    assert comparison.rows[0].train.rms == pytest.approx(finer.cost, rel=1e-9)


def test_a_file_keeps_its_name_when_all_are_saved_beside_it(tmp_path: Path) -> None:
    old = fit_plays(log()[2.0:6.0], count=3)
    file = old.save(tmp_path / "prandtl-ishlinskii.json")
    before = file.read_bytes()
    comparison = pt.compare(log(), ["prandtl-ishlinskii", file])
    assert [one.title for one in comparison.rows] == ["Prandtl-Ishlinskii 2", "Prandtl-Ishlinskii"]
    comparison.save(tmp_path)
    assert file.read_bytes() == before
    assert (tmp_path / "prandtl-ishlinskii-2.json").exists()


# What is told.


def test_the_table_marks_the_best() -> None:
    lines = comparison_of_pair().summary().splitlines()
    assert lines[0] == "fitted on 1 to 4.995 s of plays.csv, 800 samples"
    assert lines[1].endswith("600 samples; state and offset carried over")
    marked = [line[:20] for line in lines if line[2:20].strip() in ("Prandtl-Ishlinskii",)]
    assert marked == ["* Prandtl-Ishlinskii", "  Prandtl-Ishlinskii"]
    rows = [line.partition("order")[2] for line in lines if line.startswith("  Dahl, second order")]
    figures = [float(text) for text in "".join(rows).split()]
    shown = row("dahl")
    scores = [shown.train.rms, shown.test.rms, shown.test.max_error]
    assert [figures[i] for i in (0, 2, 4)] == pytest.approx([1e6 * s for s in scores], rel=1e-3)
    explained = 100.0 * (1.0 - shown.test.rms / float(np.std(comparison_of_pair().test.y)))
    assert figures[5] == pytest.approx(explained, rel=1e-3)
    assert figures[6] == 6
    best = comparison_of_pair().best
    assert shown.aic is not None
    assert best.aic is not None
    assert figures[7] == pytest.approx(shown.aic - best.aic, rel=1e-3)
    assert "doi 10.1007/b97636" in lines[-1]
    assert "Prandtl-Ishlinskii 0.0" in repr(comparison_of_pair())


def test_large_figures_stay_apart() -> None:
    rows = tuple(
        replace(one, aic=aic, bic=aic)
        for one, aic in zip(comparison_of_pair().rows, (-1.0e5, 123456.0), strict=True)
    )
    text = replace(comparison_of_pair(), rows=rows).summary()
    assert "     223456     223456" in text
    assert max(map(len, text.splitlines()[:12])) <= 80


def test_an_exact_fit_can_be_told_and_drawn() -> None:
    u = 37.5 - 37.5 * np.cos(np.arange(800) / 50.0)
    exact = pt.Dataset(u=u, y=PLAYS.simulate(u, 0.005).x, dt=0.005)
    model = pt.identification.IdentifiedModel(
        model=PLAYS, offset=0.0, offset_fitted=False, stroke=exact.stroke
    )
    comparison = pt.compare(exact, [model])
    assert comparison.best.test.rms == 0.0
    assert "Prandtl-Ishlinskii" in comparison.summary()
    plt.close(comparison.plot())


def test_the_picture_has_loops_bars_and_an_error_for_each() -> None:
    figure = comparison_of_pair().plot()
    loops, off, bars, *errors = figure.axes
    assert off.get_xlabel() == "drive [V]"
    assert loops.get_ylabel() == "displacement [\N{MICRO SIGN}m]"
    labels = [line.get_label() for line in loops.lines]
    assert labels == ["measured", "Dahl, second order", "Prandtl-Ishlinskii"]
    # Told apart without colours.
    assert len({line.get_linestyle() for line in loops.lines[1:]}) == 2
    # The loop is one cycle of what was not fitted, where one of them is furthest off.
    drawn = 1e-6 * np.asarray(loops.lines[0].get_ydata())
    assert np.isin(np.round(drawn, 12), np.round(comparison_of_pair().test.y, 12)).all()
    # Below it the difference of what is drawn above, over the same drive.
    for error, loop in zip(off.lines, loops.lines[1:], strict=False):
        unit = 1e-3 if "[nm]" in off.get_ylabel() else 1.0
        simulated = np.asarray(loop.get_ydata())
        assert np.allclose(unit * np.asarray(error.get_ydata()), 1e6 * drawn - simulated)
        assert np.allclose(np.asarray(error.get_xdata()), np.asarray(loop.get_xdata()))
    lengths = [patch.get_width() for patch in bars.patches if isinstance(patch, Rectangle)]
    scores = [one.train for one in comparison_of_pair().rows] + [
        one.test for one in comparison_of_pair().rows
    ]
    assert lengths == pytest.approx([score.rms_percent for score in scores])
    assert len(errors) == 2
    for ax, each in zip(errors, comparison_of_pair().rows, strict=True):
        fitted, judged, _, split = ax.lines
        unit = 1e-9 if "[nm]" in ax.get_ylabel() else 1e-6
        largest = [unit * float(np.abs(line.get_ydata()).max()) for line in (fitted, judged)]
        assert largest == pytest.approx([each.train.max_error, each.test.max_error])
        assert float(np.asarray(split.get_xdata())[0]) == pytest.approx(4.9975)
        assert each.title in ax.get_title(loc="left")
    assert errors[-1].get_xlabel() == "time [s]"
    plt.close(figure)


def test_another_record_is_drawn_behind_the_first() -> None:
    comparison = pt.compare(log(), ["prandtl-ishlinskii"], test=log(seed=2))
    figure = comparison.plot()
    fitted, judged = (np.asarray(line.get_xdata()) for line in figure.axes[-1].lines[:2])
    assert judged[0] == pytest.approx(fitted[-1] + 0.005)
    assert "the other record" in figure.axes[-1].get_xlabel()
    plt.close(figure)


def test_it_is_saved_with_its_models(tmp_path: Path) -> None:
    written = comparison_of_pair().save(tmp_path / "out")
    models = ["dahl.json", "prandtl-ishlinskii.json"]
    expected = ["comparison.json", "comparison.png", "comparison.svg", *models]
    assert sorted(path.name for path in written) == names(str(tmp_path / "out")) == sorted(expected)
    for each in comparison_of_pair().rows:
        assert pt.load(tmp_path / "out" / f"{each.name}.json").model == each.fit.model
    document = json.loads((tmp_path / "out" / "comparison.json").read_text())
    assert document["format"] == "piezotrack-comparison"
    assert document["best"] == "prandtl-ishlinskii"
    assert document["train"]["window_s"] == [1.0, pytest.approx(4.995)]
    assert document["train"]["sha256"] == comparison_of_pair().train.sha256
    for entry, each in zip(document["models"], comparison_of_pair().rows, strict=True):
        assert entry["test"]["rms"] == each.test.rms
        assert (entry["aic"], entry["parameters"]) == (each.aic, each.parameters)
    again = pt.compare(log(), PAIR, train=(1.0, 5.0), seed=1, runs=1, threads=1)
    for path in again.save(tmp_path / "again"):
        assert path.read_bytes() == (tmp_path / "out" / path.name).read_bytes(), path.name
    with pytest.raises(pt.DataError, match="is not a piezotrack model"):
        pt.load(tmp_path / "out" / "comparison.json")


# What is refused.

# The arguments, and what the message begins with.
REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "one name": ({"models": "dahl"}, "models is"),
    "no model": ({"models": []}, "models is empty"),
    "unknown": ({"models": ["jiles-atherton"]}, "models has 'jiles-atherton'"),
    "a stage": ({"models": [PLAYS]}, "models has 'PrandtlIshlinskiiStage'"),
    "no file": ({"models": ["gone.json"]}, "gone.json"),
    "train": ({"train": 3.0}, "train is"),
    "train of three": ({"train": (1.0, 2.0, 3.0)}, "train is"),
    "train outside": ({"train": (1.0, 30.0)}, "train: "),
    "train of words": ({"train": ("a", 3.0)}, "train: "),
    "train to the end": ({"train": (1.0, None)}, "train goes"),
    "all fitted": ({"train": (1.0, 8.0)}, "test: "),
    "test": ({"test": "5:8"}, "test is"),
    "test from the start": ({"test": (None, 4.0)}, "test begins"),
    "overlap": ({"train": (1.0, 5.0), "test": (4.0, 6.0)}, "test goes"),
    "seed": ({"models": ["dahl"], "seed": -1}, "seed is"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refuses(name: str) -> None:
    arguments, begin = REFUSED[name]
    error = pt.DataError if name == "no file" else pt.ParameterError
    with pytest.raises(error) as caught:
        pt.compare(log(), **({"models": ["prandtl-ishlinskii"]} | arguments))
    assert str(caught.value).startswith(begin)


def test_the_wording_of_a_refusal() -> None:
    with pytest.raises(pt.ParameterError) as caught:
        pt.compare(log(), "dahl")
    assert str(caught.value) == "models is 'dahl': expected several in a list, as ['dahl']"


def test_refuses_what_is_no_record() -> None:
    with pytest.raises(pt.ParameterError, match=r"data is array.*: expected a Dataset"):
        pt.compare(log().u, ["dahl"])  # type: ignore[arg-type]


# The command.


@pytest.fixture
def _logs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_log(log(), Path("log.csv"))
    write_log(log(seed=2), Path("other.csv"))
    Path("file").write_text("not a folder", encoding="utf-8")


MODELS = ("--model", "dahl", "--model", "prandtl-ishlinskii", "--runs", "1", "--seed", "1")


@pytest.mark.usefixtures("_logs")
def test_the_command_writes_what_python_finds() -> None:
    printed = ran("compare", "log.csv", *MODELS, "--window", "1:5", "--threads", "1")
    comparison = pt.compare(pt.read("log.csv"), PAIR, train=(1.0, 5.0), seed=1, runs=1)
    assert printed.startswith(comparison.summary())
    for path in comparison.save("expected"):
        assert Path("comparison", path.name).read_bytes() == path.read_bytes()
        assert path.stem in printed


@pytest.mark.usefixtures("_logs", "_no_pictures")
def test_the_command_judges_on_another_log_and_takes_files() -> None:
    second = ("--test", "other.csv", "--test-window", "2:", "--out", "a/b")
    plays = ("--model", "prandtl-ishlinskii", "--hold", "foh")
    ran("compare", "log.csv", *plays, "--window", "1:5", *second)
    document = json.loads(Path("a/b/comparison.json").read_text())
    assert document["test"]["source"] == "other.csv"
    assert document["test"]["window_s"][0] == pytest.approx(2.0)
    assert not document["carried"]
    printed = ran(
        "compare", "log.csv", "--model", "a/b/prandtl-ishlinskii.json", "--test-window", "6:"
    )
    assert "fitted on 0 to 5.995 s of log.csv" in printed


@pytest.mark.parametrize("form", [[], ["--json"]], ids=["table", "json"])
@pytest.mark.usefixtures("_logs", "_no_pictures")
def test_ctrl_c_keeps_the_models_that_are_done(
    form: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second of three fits is interrupted."""
    only = pt.compare(pt.read("log.csv"), ["prandtl-ishlinskii"], train=(1.0, 5.0))
    fitted: list[str] = []

    def interrupted(data: pt.Dataset, name: str, **options: Any) -> Any:
        if fitted:
            raise KeyboardInterrupt
        fitted.append(name)
        return pt.identify(data, name, **options)

    module = "piezotrack.identification.comparison.compare"
    monkeypatch.setattr(sys.modules[module], "identify", interrupted)
    plays = ("--model", "prandtl-ishlinskii", "--model", "preisach", "--model", "duhem")
    done = run("compare", "log.csv", *plays, "--window", "1:5", "--out", "out", *form)
    assert done.exit_code == 130
    said = without_progress(done.stderr)
    assert re.fullmatch(r"piezotrack: interrupted after 1 of 3 models; [^\n]* out\n", said)
    assert names("out") == ["comparison.json", "prandtl-ishlinskii.json"]
    if form:
        document = json.loads(done.stdout)
        assert [one["name"] for one in document["models"]] == ["prandtl-ishlinskii"]
        assert "interrupted after 1 of 3 models" in document["notes"]
    else:
        assert done.stdout.startswith(only.summary())


@pytest.mark.usefixtures("_logs")
def test_ctrl_c_in_the_first_model_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: Any, **__: Any) -> Any:
        raise KeyboardInterrupt

    module = "piezotrack.identification.comparison.compare"
    monkeypatch.setattr(sys.modules[module], "identify", interrupted)
    done = run("compare", "log.csv", *MODELS, "--out", "out")
    assert (done.exit_code, done.stdout) == (130, "")
    assert not Path("out", "comparison.json").exists()


REFUSED_COMMANDS: dict[str, tuple[str, ...]] = {
    "compare gone.csv": ("gone.csv: there is no such file",),
    "compare log.csv --model jiles-atherton": ("log.csv: --model has 'jiles-atherton'", "'dahl'"),
    "compare log.csv --model gone.json": ("gone.json: there is no such file in '.'",),
    "compare log.csv --model log.json": ("log.json",),
    "compare log.csv --window 5": ("--window is '5'", "expected A:B"),
    "compare log.csv --window a:b": ("--window has 'b'", "number"),
    "compare log.csv --window 1:": ("nothing to validate on", "or --test"),
    "compare log.csv --test-window :4": ("nothing to fit", "or --window"),
    "compare log.csv --window 1:30": (
        "log.csv: ",
        "the window from 1 s to 30 s",
    ),
    "compare log.csv --window 1:5 --test-window 4:6": (
        "log.csv: --test-window goes from 4",
        "do not overlap",
    ),
    "compare log.csv --test gone.csv": ("gone.csv: there is no such file",),
    "compare log.csv --test other.csv --test-window 50:": (
        "other.csv: --test-window 50:",
        "start < stop",
    ),
    "compare log.csv --out file": ("file cannot be made a folder",),
    "compare log.csv --model dahl --seed -1": ("seed is -1", "0 or above"),
    "compare log.csv --model dahl --runs 0": ("runs is 0", "1 or more"),
}


@pytest.mark.usefixtures("_logs")
@pytest.mark.parametrize("command", REFUSED_COMMANDS)
def test_the_command_refuses(command: str) -> None:
    sentence = refusal(*command.split())
    for piece in REFUSED_COMMANDS[command]:
        assert piece in sentence
    assert names(".") == ["file", "log.csv", "other.csv"]
    assert "pt." not in sentence


@pytest.mark.skipif(not MEASURED.is_dir(), reason=f"the measured logs are not in {MEASURED}")
def test_on_the_measured_log_plays_are_best() -> None:
    other = pt.read(MEASURED / "tracking.csv")[3.0:]
    training = pt.read(MEASURED / "training.csv")
    comparison = pt.compare(training, PAIR, train=(3.0, 23.0), test=other, seed=1)
    plays = row("prandtl-ishlinskii", comparison)
    assert plays.train.rms_percent <= 0.6
    assert plays.test.rms_percent <= 1.1
    assert comparison.best is plays
    # Even there neighbours are alike, so the criteria are to be read with care.
    assert plays.autocorrelation > 0.5


def test_a_record_that_is_a_part_of_what_was_fitted_does_not_judge() -> None:
    with pytest.raises(pt.ParameterError, match="expected windows that do not overlap"):
        pt.compare(log(), ["prandtl-ishlinskii"], train=(1.0, 3.0), test=log()[2.0:4.0])


def test_a_model_that_was_fitted_on_what_judges_it_is_remarked_upon() -> None:
    named = pt.Dataset(u=log().full.u, y=log().full.y, dt=log().dt, source="log.csv")
    fit = pt.identify(named[1.0:6.0], "prandtl-ishlinskii")
    found = pt.compare(named, [fit, "prandtl-ishlinskii"], train=(1.0, 3.0), test=(4.0, 7.0))
    assert len(found.notes) == 1
    assert "was fitted on 1 to 5.9" in found.summary()
