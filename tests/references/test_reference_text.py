"""References from files and from text."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.typing import NDArray

import piezotrack as pt

if TYPE_CHECKING:
    from pathlib import Path

Array = NDArray[np.float64]

UM = 1e-6
PAGE_ONE: dict[str, Any] = {"frequency": 0.2, "low": 0.0, "high": 110e-6, "duration": 20.0}
RANGE: dict[str, Any] = {"low": 10e-6, "high": 60e-6, "duration": 6.0}
LINES = [0.5, 1.0, 1.5, 2.5]


# Files.


def write(folder: Path, columns: dict[str, Any], name: str = "target.csv") -> Path:
    path = folder / name
    lines = [",".join(columns)]
    lines += [",".join(map(repr, map(float, row))) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(lines))
    return path


T: Array = 0.05 * np.arange(41.0)
Y = 10.0 + 5.0 * np.sin(3.0 * T)


def test_reads_a_file(tmp_path: Path) -> None:
    path = write(tmp_path, {"time_ms": np.round(1e3 * T + 700.0), "displacement_um": Y})
    reference = pt.references.read_reference(path)
    samples = reference.sample(0.05)
    np.testing.assert_allclose(samples.x, Y * UM, rtol=1e-12)
    np.testing.assert_allclose(samples.v[5:-5], 15e-6 * np.cos(3.0 * T[5:-5]), atol=1e-10)
    assert (reference.name, samples.t[0]) == ("target.csv", 0.0)


def test_a_column_called_reference_goes_first(tmp_path: Path) -> None:
    columns = {"time_s": T, "voltage_V": T, "displacement_um": 0.0 * T, "Reference (um)": Y}
    path = write(tmp_path, columns)
    np.testing.assert_allclose(
        pt.references.read_reference(path).sample(0.05).x, Y * UM, rtol=1e-12
    )
    named = pt.references.read_reference(path, displacement="displacement", dt=0.1)
    assert named.duration == pytest.approx(4.1)
    assert not named.sample(0.1).x.any()


def test_a_file_repeats_if_it_is_told_to(tmp_path: Path) -> None:
    turn = 2.0 * np.pi * np.arange(40) / 40
    path = write(tmp_path, {"time_s": 0.05 * np.arange(40.0), "x_um": 10.0 * np.cos(turn)})
    reference = pt.references.read_reference(path, period=2.0, duration=10.0, ramp=1.0)
    assert (reference.period, reference.duration, reference.ramp) == (2.0, 10.0, 1.0)
    assert reference.at(8.0)[0] == pytest.approx(10e-6)


BAD_FILES: list[tuple[str, dict[str, Any], str]] = [
    ("time_s,x_um\n0,1\n0.1,2\n0.3,x\n0.3,4\n", {}, r"target.csv:4: 'x' in column 'x_um'"),
    ("time_s,x_um\n0,1\n0.1,2\n0.3,3\n0.4,4\n", {}, r"target.csv:4: .*t is not even"),
    ("time_s,x\n0,1\n0.1,2\n", {}, r"target.csv:1: column 'x' has no unit"),
    ("time_s,x_um\n0,1\n0.1,2\n0.2,3\n", {}, r"target.csv: x has 3 samples: expected at least 6"),
    ("time_s,z_um\n0,1\n0.1,2\n", {}, r"name it with displacement="),
    (
        "time_s,x_um\n" + "".join(f"{k},{k}\n" for k in range(9)),
        {"period": 20.0},
        r"target.csv: period is 20 s: .*at most the length of the record, 9 s",
    ),
]


@pytest.mark.parametrize(("text", "more", "message"), BAD_FILES)
def test_a_file_that_cannot_be_used_is_named(
    tmp_path: Path, text: str, more: dict[str, Any], message: str
) -> None:
    path = tmp_path / "target.csv"
    path.write_text(text)
    with pytest.raises((pt.DataError, pt.ParameterError), match=message):
        pt.references.read_reference(path, **more)


# References as text.

PAGE_ONE_TEXT = "sine:0.2Hz,0..110um"
TEXTS: dict[str, pt.Reference] = {
    PAGE_ONE_TEXT: pt.sine(**PAGE_ONE),
    " Sine : 200 mHz , 0 .. 0.11 mm , 20s ": pt.sine(**PAGE_ONE),
    "sine:0.2hz,0..110\N{MICRO SIGN}m,phase=90deg,ramp=500ms": pt.sine(
        phase=math.pi / 2, ramp=0.5, **PAGE_ONE
    ),
    "sine:0.2Hz,0um..0.11mm,phase=-1e-1rad,ramp=0s": pt.sine(phase=-0.1, ramp=0.0, **PAGE_ONE),
    "triangle:0.5Hz,10..60um,6s,rounding=0.3": pt.triangle(frequency=0.5, rounding=0.3, **RANGE),
    "triangle:0.5Hz,-5..5nm": pt.triangle(frequency=0.5, low=-5e-9, high=5e-9, duration=8.0),
    "chirp:0.5..3Hz,10..60um,6s": pt.chirp(start_frequency=0.5, stop_frequency=3.0, **RANGE),
    "chirp:500mHz..3Hz,10..60um,0.1min": pt.chirp(start_frequency=0.5, stop_frequency=3.0, **RANGE),
    "staircase:5,0..100um,dwell=1s": pt.staircase(steps=5, low=0.0, high=100e-6, dwell=1.0),
    "staircase:5,0..100um,dwell=1s,rise=0.1s,30s": pt.staircase(
        steps=5, low=0.0, high=100e-6, dwell=1.0, rise=0.1, duration=30.0
    ),
    "staircase:levels=0/30/10um,dwell=1s": pt.staircase(levels=[0.0, 30e-6, 10e-6], dwell=1.0),
    "multisine:0.5/1/1.5/2.5Hz,10..60um,6s": pt.multisine(frequencies=LINES, **RANGE),
    "multisine:0.5/1/1.5/2.5Hz,10..60um,6s,seed=7": pt.multisine(
        frequencies=LINES, seed=7, **RANGE
    ),
}


@pytest.mark.parametrize("text", TEXTS)
def test_reads_a_text(text: str) -> None:
    parsed, expected = pt.parse_reference(text), TEXTS[text]
    assert (parsed.name, repr(parsed)) == (expected.name, repr(expected))
    assert parsed.duration == pytest.approx(expected.duration, rel=1e-14)
    assert parsed.ramp == pytest.approx(expected.ramp, rel=1e-14)
    one, other = parsed.sample(0.01), expected.sample(0.01)
    np.testing.assert_allclose(one.x, other.x, rtol=0.0, atol=1e-17)


def test_the_duration_of_the_text_goes_first() -> None:
    assert pt.parse_reference(PAGE_ONE_TEXT, duration=7.0).duration == 7.0
    assert pt.parse_reference(PAGE_ONE_TEXT + ",9s", duration=7.0).duration == 9.0
    assert pt.parse_reference("chirp:1..2Hz,0..5um", duration=7.0).duration == 7.0


def test_a_file_is_read_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, {"time_s": T, "displacement_um": Y})
    assert pt.parse_reference(str(path)).name == "target.csv"
    assert pt.parse_reference(str(path), duration=1.0).duration == 1.0
    monkeypatch.chdir(tmp_path)
    path.rename(tmp_path / "sine")
    assert pt.parse_reference("sine").name == "sine"


BAD_TEXTS = {
    "": "expected a file or one of sine:0.2Hz",
    "sine": "there is no frequency: expected sine:FREQUENCY,LOW..HIGH.* as in sine:0.2Hz,0..110um",
    "sine:0.2Hz": "there is no range: expected sine:FREQUENCY",
    "sine:0.2,0..110um": "'0.2' has no unit: expected sine:FREQUENCY",
    "sine:0.2Hz,0..110": r"'0..110' has no unit",
    "sine:0.2Hz,0..110furlong": "unknown unit 'furlong': expected one of Hz",
    "sine:0.2MHz,0..110um": "unknown unit 'MHz'",
    "sine:0.2Hz,0..110um,1Hz": "'1Hz' gives frequency a second time",
    "sine:0.2Hz,0..110V": r"'0..110V' has no place here",
    "sine:0.2Hz,0..5..9um": "has 3 values: expected two",
    "sine:0.2Hz,0s..9um": "mixes s and um",
    "sine:0.2Hz,low..9um": "'low' in 'low..9um' is not a number",
    "sine:0.2Hz,0..110um,wobble=3s": "'wobble' is not one of phase, ramp",
    "sine:0.2Hz,0..110um,ramp=3": "'ramp=3' has the wrong unit: expected time, unit s, ms",
    "sine:0.2Hz,110..0um": "low is 110 um: expected less than high, 0 um",
    "triangle:1Hz,0.1mm..5um": "low is 0.1 mm: expected less than high, 5 um",
    "staircase:5,5.5 .. 5.5 um,dwell=1s": "low is 5.5 um: expected less than high",
    "sine:1Hz,5:40um": "a range has two dots, as in",
    "sine:0Hz,0..110um": "frequency is 0: expected a finite number above 0",
    "sine:1Hz,5-40um": "a range has two dots, as in",
    "sine:nanHz,0..110um": "not a number",
    "triangle:1Hz,0..5um,rounding=2": "rounding is 2: expected",
    "chirp:0.1..5Hz,0..110um": "there is no duration: expected chirp:START",
    "chirp:5Hz,0..110um,20s": "'5Hz' has no place here",
    "staircase:5,0..100um": "there is no dwell",
    "staircase:5.5,0..100um,dwell=1s": "steps is 5.5",
    "staircase:levels=0..9um,dwell=1s": "cannot be understood",
    "staircase:dwell=1s": "steps and levels: expected exactly one",
    "multisine:0.5/1Hz,0..110um": "there is no duration",
    "multisine:0.5/1Hz,0..110um,2s,seed=0.5": "seed is 0.5",
    "sinus:0.2Hz,0..110um": "neither a file nor a known kind.*sine:0.2Hz,0..110um, triangle",
    "ramp": "neither a file nor a known kind",
    "x:" + "9" * 5000: "neither a file nor a known kind|no such file",
}


@pytest.mark.parametrize("text", BAD_TEXTS, ids=lambda text: text[:30])
def test_a_text_that_cannot_be_understood_shows_what_can(text: str) -> None:
    with pytest.raises(pt.ParameterError, match=BAD_TEXTS[text]) as caught:
        pt.parse_reference(text)
    assert str(caught.value).startswith(f"reference {text!r}"[:60]) or not text


def test_a_missing_file_is_named() -> None:
    for text in ("missing.csv", "C:\\data\\missing.csv", "folder/missing.csv"):
        with pytest.raises(pt.DataError, match=re.escape("missing.csv: there is no such file")):
            pt.parse_reference(text)


def test_three_dots_are_no_decimal_point() -> None:
    with pytest.raises(pt.ParameterError, match="three dots"):
        pt.parse_reference("sine:0.2Hz,0...110um")


def test_loops_take_the_text_of_a_reference() -> None:
    stage = pt.VirtualStage.xu_li_2010(seed=1)
    loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
    text = "sine:0.5Hz,0..100um,4s"
    run, same = (pt.track(stage, loop, one) for one in (text, pt.parse_reference(text)))
    assert np.array_equal(run.measured, same.measured)
    quick: dict[str, Any] = {
        "dt": 0.02,
        "limits": (0.0, 75.0),
        "feedforward": None,
        "search": pt.TuningSearch(particles=4, iterations=1),
    }
    tuned, twin = (pt.tune(stage, one, **quick) for one in (text, [pt.parse_reference(text)]))
    assert tuned.document() == twin.document()
    xy, path = pt.XYStage.xu_li_2010(seed=1), "circle:0.5Hz,10um,4s,centre=50/50um"
    around, twice = (
        pt.contour(xy, (loop, loop), one) for one in (path, pt.references.parse_path(path))
    )
    assert np.array_equal(around.x.measured, twice.x.measured)


@pytest.mark.parametrize("wrong", ["sinus:1Hz", "sine:1Hz", "", "missing.csv", 3.0, None])
def test_a_wrong_text_is_refused_by_the_name_of_the_argument(wrong: Any) -> None:
    stage = pt.VirtualStage.xu_li_2010(seed=1)
    loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
    for call in (lambda: pt.track(stage, loop, wrong), lambda: pt.tune(stage, [wrong], dt=0.02)):
        with pytest.raises(pt.PiezotrackError) as caught:
            call()
        if wrong != "missing.csv":
            assert isinstance(caught.value, pt.ParameterError)
            assert caught.value.argument == "reference"
