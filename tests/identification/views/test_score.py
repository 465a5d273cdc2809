"""The score of a record: where the model is furthest off, and which share of it was fitted."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import piezotrack as pt
from commands import run
from piezotrack.data.log_file import write_log
from play_records import PLAIN, fit_plays, record


def log() -> pt.Dataset:
    return record(PLAIN)


@cache
def half() -> pt.identification.Identification:
    return fit_plays(log()[:1.5], count=4, creep=False, dynamics=None)


@pytest.mark.parametrize("when", [0.4, 2.345])
def test_the_time_of_the_largest_error_is_that_of_the_record(when: float) -> None:
    data = log()
    away = np.abs(data.t - when) < 2.5e-3
    # Several readings, which are no glitch; the middle one is furthest off.
    y = data.y + 2e-6 * away + 1e-6 * (np.abs(data.t - when) < 0.5e-3)
    score = half().score(pt.Dataset(t=data.t, u=data.u, y=y)[0.2:])
    assert score.max_error_time == pytest.approx(when, abs=1e-9)
    assert score.max_error == pytest.approx(3e-6, rel=0.1)
    assert f"at {when:g} s" in str(score)
    # A notebook shows it as it is printed.
    assert str(score) in repr(score)


def test_the_share_that_was_fitted_is_counted_by_samples(tmp_path: Path) -> None:
    data = log()
    stored = pt.load(half().save(tmp_path / "half.json"))
    for model in (half(), stored):
        assert model.score(data[:1.5]).fitted_share == 1.0
        assert model.score(data).fitted_share == pytest.approx(0.5, abs=1e-3)
        assert model.score(data[1.0:2.0]).fitted_share == pytest.approx(0.5, abs=2e-3)
        assert model.score(data[1.6:]).fitted_share == 0.0
        other = pt.Dataset(u=data.u, y=data.y + 1e-9, dt=data.dt)
        assert model.score(other).fitted_share == 0.0


def test_the_share_of_several_records_is_that_of_all_their_windows() -> None:
    data = log()
    method = pt.LeastSquares(count=4, creep=False, dynamics=None)
    fit = pt.identify([data[:1.0], data[2.0:]], "prandtl-ishlinskii", method=method)
    assert fit.score(data).fitted_share == pytest.approx(2.0 / 3.0, abs=2e-3)
    assert fit.score(data[1.1:1.9]).fitted_share == 0.0


@pytest.mark.usefixtures("_no_pictures")
@pytest.mark.parametrize(
    ("window", "message"), [(":1.5", " s, fitted:"), ("1:2", " s, 50"), ("1.6:", " s, not fitted")]
)
def test_validation_says_which_share_was_fitted(
    window: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_log(log(), Path("log.csv"))
    arguments = ("identify", "log.csv", "--window", ":1.5", "--model", "prandtl-ishlinskii")
    done = run(*arguments, "--test", "log.csv", "--test-window", window)
    line = next(one for one in done.output.splitlines() if one.startswith("on log.csv"))
    assert message in line, done.output
