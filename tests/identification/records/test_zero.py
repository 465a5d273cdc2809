"""The zero of a record, and of the models and stages that come of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from commands import ran, refusal

if TYPE_CHECKING:
    from pathlib import Path

DT = 0.005
OFFSET = -120e-6


def log_of(*, rest: int = 200, noise: float = 2e-9) -> pt.Dataset:
    """A log of plays that begins at -120 um, at rest for a second."""
    t = np.arange(1600) * DT
    u = np.r_[np.zeros(rest), 30.0 - 30.0 * np.cos(2.0 * np.pi * t)]
    stage = pt.PrandtlIshlinskiiStage(linear=0.6e-6, thresholds=(5.0, 15.0), weights=(1e-7, 1e-7))
    y = stage.simulate(u, DT).x + OFFSET
    return pt.Dataset(u=u, y=y + noise * np.random.default_rng(3).standard_normal(u.size), dt=DT)


@pytest.fixture(scope="module")
def fit() -> pt.identification.Identification:
    return pt.identify(log_of(), "prandtl-ishlinskii")


def test_the_zero_is_the_reading_at_rest_before_the_drive_moves() -> None:
    log = log_of(noise=50e-9)
    zeroed = log.zeroed()
    # The median of 200 readings, not the first of them.
    assert zeroed.zero == pytest.approx(OFFSET, abs=12e-9)
    assert np.allclose(zeroed.y + zeroed.zero, log.y, rtol=0.0, atol=1e-18)
    assert log.zero == 0.0
    assert zeroed.stroke == pytest.approx(log.stroke)
    # One that moves at once: its first reading.
    moving = log.cut(1.3)
    assert moving.zeroed().zero == moving.y[0]
    # Once is enough, and a window has the zero of its record.
    assert zeroed.zeroed().zero == pytest.approx(zeroed.zero, abs=1e-18)
    assert log[2.0:4.0].zeroed().zero == zeroed.zero == zeroed[2.0:4.0].zero
    assert zeroed.decimate(2).zero == zeroed.zero


def test_readings_that_do_not_count_are_no_zero() -> None:
    log = log_of()
    y = log.y.copy()
    y[:120], y[130] = np.nan, 1e-3
    lost = pt.Dataset(u=log.u, y=y, dt=DT, missing="drop").zeroed()
    assert lost.zero == pytest.approx(OFFSET, abs=1e-9)
    assert np.isnan(lost.recorded).sum() == 120
    assert lost.recorded[500] == lost.y[500]


def test_a_zeroed_model_is_that_of_a_zeroed_record(
    fit: pt.identification.Identification, tmp_path: Path
) -> None:
    log = log_of()
    same = pt.identify(log.zeroed(), "prandtl-ishlinskii")
    zeroed = fit.zeroed()
    assert zeroed.zero == pytest.approx(OFFSET, abs=50e-9)
    assert zeroed.offset == pytest.approx(same.offset, abs=50e-9)
    assert zeroed.model == fit.model
    # It is kept in the file, and does not add up.
    read = pt.load(zeroed.save(tmp_path / "model.json"))
    assert (read.offset, read.zero) == (zeroed.offset, zeroed.zero)
    assert read.zeroed().offset == zeroed.offset
    # The stage, the feedforward and the loop have the same zero.
    reference = "triangle:1Hz,2..40um,2s"
    loop = pt.Controller(dt=DT, limits=(0.0, 60.0), feedforward=zeroed.inverse())
    assert pt.track(zeroed, loop, reference).metrics.max_error < 1e-6


def test_a_reference_of_another_zero_is_refused_with_the_remedy(
    fit: pt.identification.Identification,
) -> None:
    loop = pt.Controller(dt=DT, limits=(0.0, 60.0), feedforward=fit.inverse())
    with pytest.raises(pt.ParameterError, match=r"expected -120.* um .*fit\.zeroed\(\)"):
        pt.track(fit, loop, "triangle:1Hz,2..40um,2s")
    # One that no zero brings within reach has no such remedy.
    with pytest.raises(pt.ParameterError) as caught:
        pt.track(fit, loop, "triangle:1Hz,0..400um,2s")
    assert "zeroed" not in str(caught.value)


@pytest.mark.usefixtures("_no_pictures")
def test_commands_take_the_zero(
    fit: pt.identification.Identification, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    fit.save("model.json")
    motion = ("triangle:1Hz,2..40um,2s", "--kp", "0.01", "--ti", "0.01")
    assert "; --zero takes the beginning" in refusal("track", "model.json", *motion)
    assert "zeroed: -120 um subtracted" in ran("track", "model.json", *motion, "--zero")
    text = "triangle:1Hz,2..40um,2s"
    assert "--zero" in refusal("feedforward", "model.json", text)
    assert "zeroed" in ran("feedforward", "model.json", text, "--zero", "--out", "table")
    log_of().save("log.npz")
    ran("convert", "log.npz", "zeroed.npz", "--zero")
    assert np.array_equal(pt.read("zeroed.npz").y, log_of().zeroed().y)


def test_a_virtual_stage_has_the_zero_that_is_asked_for(
    fit: pt.identification.Identification, tmp_path: Path
) -> None:
    path = fit.save(tmp_path / "model.json")
    for address, expected in ((f"virtual:{path}", OFFSET), (f"virtual:{path}?zero", 0.0)):
        log = pt.measure(pt.hardware.connect(address), "decaying:1Hz,0..60V", rate=200.0)
        assert log.full.y[0] == pytest.approx(expected, abs=0.1e-6)
    for wrong in (f"virtual:{path}?zero=1", f"virtual:{path}?seed", "virtual:?zero"):
        with pytest.raises(pt.ParameterError, match=r"MODEL\.json\?zero"):
            pt.hardware.connect(wrong)
