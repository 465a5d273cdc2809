"""The published numbers, what is told of those obtained, and what a reproduction is given."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from commands import refusal
from folders import MEASURED
from piezotrack.xu_li_2010.apparatus import Apparatus, calibration_file
from piezotrack.xu_li_2010.free_parameters import FREE, apparatus_at
from piezotrack.xu_li_2010.measured_log import drives
from piezotrack.xu_li_2010.published import Observable, Obtained, Use, observables
from piezotrack.xu_li_2010.views.report_text import tally

if TYPE_CHECKING:
    from pathlib import Path


def test_the_published_numbers_are_those_of_the_paper() -> None:
    # Typed again from the paper, not read from the package.
    expected = {
        "rest.rms": 0.097e-6,
        "step.steady": 117.7622e-6,
        "step.peak_1": 192.5302e-6,
        "step.period": 0.0058,
        "forward.max": 5.69e-6,
        "back.lag": 0.063,
        "back.loop": 0.0624,
        "both.loop": 0.0176,
        "windup.without": 6.35e-6,
        "repetitive.without": 2.29e-6,
        "circle.20um.0.2Hz.sd": 0.480e-6,
        "circle.40um.0.5Hz.max": 7.048e-6,
    }
    known = {one.key: one for one in observables()}
    for key, value in expected.items():
        assert known[key].published == pytest.approx(value, rel=1e-12), key
    assert known["step.zeta"].published == pytest.approx(1.5759 / (2 * 12.0806), rel=1e-4)


def test_what_was_to_be_left_out_is() -> None:
    for observable in observables():
        left_out = observable.figure[:2] in ("13", "14") or observable.key.startswith("circle.40um")
        # And what no record at 0.25 Hz tells.
        left_out = left_out or observable.key == "table_1.mass"
        # A ratio of two published numbers is neither.
        derived = observable.key.endswith(".ratio")
        left_out = left_out and not derived
        assert (observable.use == "left out") == left_out, observable.key
        assert (observable.use == "derived") == derived, observable.key
        assert observable.calibrated != (left_out or derived), observable.key
    fitted = {entry["key"] for entry in calibration_file().get("observables", [])}
    assert fitted <= {one.key for one in observables() if one.calibrated}


def made(
    kind: str,
    published: float,
    *,
    calibrated: bool,
    unit: str = "um",
    key: str = "k",
    use: Use | None = None,
) -> Observable:
    use = use or ("calibrated" if calibrated else "left out")
    return Observable(
        key=key, figure="1", name=f"n {key}", unit=unit, published=published, kind=kind,  # type: ignore[arg-type]
        use=use, how="",
    )  # fmt: skip


def test_goals() -> None:
    # 15 % or one step of the sensor, 30 % or two.
    large, small = made("value", 2e-6, calibrated=True), made("value", 0.1e-6, calibrated=True)
    assert large.agrees(2.29e-6)
    assert not large.agrees(2.31e-6)
    assert small.agrees(0.061e-6)
    assert not small.agrees(0.145e-6)
    assert made("value", 2e-6, calibrated=False).agrees(2.59e-6)
    assert not made("value", 0.063, calibrated=True, unit="rad").agrees(0.073)
    bound = made("bound", 1.5e-6, calibrated=False)
    assert bound.agrees(0.2e-6)
    assert not bound.agrees(1.51e-6)


def test_medians_and_quartiles_of_a_hand_made_array() -> None:
    obtained = Obtained(observable=made("value", 2.0, calibrated=True), values=(1.0, 5.0, 2.0, 4.0))
    assert obtained.median == 3.0
    assert obtained.quartiles == (1.75, 4.25)
    assert obtained.ratio == 1.5


def test_what_is_put_in_is_what_the_stage_is_set_to() -> None:
    given = {one.key for one in observables() if one.use == "put in"}
    assert given == {"rest.rms", "rest.step", "step.steady"}
    # Whatever the free parameters are: y's own displacement apart, they move none of the three.
    theta = {one.name: one.at(0.3) for one in FREE}
    x = apparatus_at(theta).x
    noise, step = x.sensor.noise, x.sensor.resolution
    assert step == pytest.approx(2.5e-3 / 2**16)
    # With the steps, the noise makes 0.097 um.
    assert math.hypot(noise, step / math.sqrt(12.0)) == pytest.approx(0.097e-6, rel=1e-3)
    end = x.simulate(np.full(300, 75.0), 1e-3, hold="zoh").x[-100:].mean()
    assert end == pytest.approx(117.7622e-6, rel=1e-3)


def test_the_tally_counts_by_use() -> None:
    def row(key: str, value: float, use: Use) -> Obtained:
        known = made("value", 2e-6, calibrated=False, key=key, use=use)
        return Obtained(observable=known, values=(value,))

    good, bad = 2e-6, 9e-6
    rows = [
        row("a", good, "calibrated"), row("b", bad, "calibrated"), row("c", good, "put in"),
        row("circle.d", good, "left out"), row("circle.e", bad, "left out"),
        row("f", bad, "left out"), row("g", good, "left out"), row("circle.h", bad, "derived"),
    ]  # fmt: skip

    class Found:
        obtained, seeds = tuple(rows), (1,)

    fitted, left_out, ratios = tally(Found())  # type: ignore[arg-type]
    assert "2 of 3 calibrated" in fitted
    assert "1 of them were put in: n c (Fig. 1)" in fitted
    assert "2 of 4 numbers left out" in left_out
    assert "1 of 2 of circles" in left_out
    assert "1 of 2 others. Not reached of these: n f (Fig. 1)." in left_out
    assert "1 circles" in ratios
    assert "gives 2.83" in ratios


def test_another_apparatus_has_to_be_one() -> None:
    with pytest.raises(pt.ParameterError, match="apparatus is int: expected"):
        pt.xu_li_2010.reproduce(apparatus=5)  # type: ignore[arg-type]


def test_an_apparatus_survives_its_file() -> None:
    apparatus = Apparatus.calibrated()
    assert Apparatus.of(json.loads(json.dumps(apparatus.document()))) == apparatus
    assert apparatus.seeded(3).x.sensor.seed != apparatus.seeded(3).y.sensor.seed
    stage = dataclasses.replace(apparatus.stage, missed_ticks=0.1, most_behind=4)
    late = dataclasses.replace(apparatus, stage=stage)
    assert Apparatus.of(json.loads(json.dumps(late.document()))) == late != apparatus
    # One that was written when there were no ticks to miss.
    older = apparatus.document()
    del older["missed_ticks"], older["most_behind"]
    assert Apparatus.of(older) == apparatus


@pytest.mark.parametrize("seeds", [0, 1001])
def test_seeds_are_refused(seeds: int) -> None:
    with pytest.raises(pt.ParameterError, match=f"seeds is {seeds}: expected 1 to 1000"):
        pt.xu_li_2010.reproduce(seeds=seeds)


def test_the_way_on_the_measured_log() -> None:
    if not MEASURED.is_dir():
        pytest.skip(f"the measured logs are not in {MEASURED}")
    comparison = drives(MEASURED)
    off = {name: comparison.computed[name] - comparison.measured for name in comparison.computed}
    line = np.sqrt(np.mean((comparison.line - comparison.measured) ** 2))
    # A line through their drive leaves 180 mV; every inverse explains most of that.
    assert line == pytest.approx(0.1795, abs=1e-3)
    for name, error in off.items():
        assert np.sqrt(np.mean(error**2)) < 0.55 * line, name
        assert abs(error.mean()) < 1e-12
    assert len(comparison.section().rows) == 4


def test_a_missing_log_is_named(tmp_path: Path) -> None:
    with pytest.raises(pt.DataError, match=r"training\.csv"):
        pt.xu_li_2010.reproduce(seeds=1, dbo=tmp_path)


def test_the_command_refuses(tmp_path: Path) -> None:
    out = str(tmp_path / "report")
    assert refusal("reproduce", "--draws", "0", "--out", out) == "--draws is 0: expected 1 to 1000"
    assert "training.csv" in refusal("reproduce", "--dbo", str(tmp_path), "--out", out)
    assert not (tmp_path / "report").exists()
