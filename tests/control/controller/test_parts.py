"""Every part that the core lists has a class, an entry in files, and numbers for the core."""

from __future__ import annotations

import math
from dataclasses import MISSING, fields
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from folders import ROOT
from piezotrack.control.parts.file_entries import part_entry, part_of
from piezotrack.control.parts.part import FeedbackLaw, Part, part_class
from piezotrack.control.parts.part_info import LISTED, names_of
from piezotrack.control.tuning.structures import SOUGHT, Nominal, law_of
from piezotrack.errors import ParameterError

if TYPE_CHECKING:
    from pathlib import Path

    from piezotrack.control.parts.part_info import Number

LAWS, PARTS = names_of("law"), tuple(LISTED)
LISTS: dict[str, dict[str, Any]] = {
    "state-space": {"a": [[0.5]], "b": [1e3], "c": [1.0]},
    "scheduled-pid": {"amplitudes": [1e-5], "rates": [1.0]},
}
STAGES = {"dahl": pt.DahlStage.xu_li_2010(), "bouc-wen": pt.BoucWenStage.xu_li_2010()}
# One of each unit, within every range.
SIZES = {"V/m/s": 1e5, "V/m": 1e5, "m/V": 1.5e-6, "V": 3.0, "m": 2e-5, "s": 0.3, "Hz": 5.0, "": 0.5}


def value_of(law: str, number: Number) -> Any:
    match number.form:
        case "part":
            return made(number.choices[0])
        case "parts":
            return [made(number.choices[0])]
        case "stage":
            return STAGES[number.choices[0]]
        case "word":
            return number.choices[-1]
        case "count":
            return 3
        case "truth":
            return True
        case "numbers" | "matrix":
            return LISTS[law].get(number.name)
    return SIZES[number.unit]


def made(name: str) -> Any:
    """Make a part with a value for each number that the core lists."""
    return part_class(name)(**{one.name: value_of(name, one) for one in LISTED[name].numbers})


def test_each_name_is_there_once_and_in_the_spelling_of_files() -> None:
    assert len(LAWS) == 11
    assert set(names_of("filter")) == {"low-pass", "notch"}
    for name in PARTS:
        assert name == name.lower().replace(" ", "-")


@pytest.mark.parametrize("name", PARTS)
def test_the_class_of_a_part_has_the_numbers_and_defaults_of_the_core(name: str) -> None:
    info, kind = LISTED[name], part_class(name)
    assert issubclass(kind, FeedbackLaw if info.role == "law" else Part)
    assert kind.info is info
    attributes = {one.name: one for one in fields(kind)}
    assert attributes.keys() == {one.name for one in info.numbers}
    for number in info.numbers:
        default = attributes[number.name].default
        if number.default is not None:
            expected = (
                number.choices[int(number.default)] if number.form == "word" else number.default
            )
            assert default == expected
        elif number.is_optional:
            assert default is None or isinstance(default, Part)
        else:
            assert default is MISSING
    assert getattr(pt.control, kind.__name__) is kind


@pytest.mark.parametrize("name", PARTS)
def test_a_part_comes_back_from_its_entry(name: str) -> None:
    part = made(name)
    entry = part_entry(part, "V")
    assert entry["kind"] == name
    again = part_of("it", entry, PARTS, "V")
    assert type(again) is type(part)
    assert part_entry(again, "V") == entry
    assert name == "state-space" or again == part
    # In another unit of the drive the keys say so.
    in_metres = part_entry(part, "m")
    assert all("V" not in key for key in in_metres)
    assert part_entry(part_of("it", in_metres, PARTS, "m"), "m") == in_metres


@pytest.mark.parametrize("name", LAWS)
def test_the_core_takes_a_law_by_its_name_and_numbers(name: str) -> None:
    loop = pt.Controller(dt=0.02, limits=(-1e3, 1e3), feedback=made(name))
    assert made(name)._settings[0] == name
    assert math.isfinite(loop.start().step(1e-6, 0.0))
    assert LISTED[name].title in repr(loop)
    above, below = pt._core.law_transfer_function(made(name)._settings, loop.dt)
    assert len(above) <= len(below)


@pytest.mark.parametrize(
    ("count", "words"), [(0, "75 V)"), (1, ", 1 filter)"), (2, ", 2 filters)")]
)
def test_a_controller_counts_its_filters(count: int, words: str) -> None:
    filters = [pt.Notch(100.0 + k) for k in range(count)]
    assert repr(pt.Controller(dt=1e-3, limits=(0.0, 75.0), filters=filters)).endswith(words)


@pytest.mark.parametrize("name", LAWS)
def test_the_core_refuses_a_number_too_many(name: str) -> None:
    _, numbers = made(name)._settings
    with pytest.raises(ParameterError, match=r"with \d+ numbers|back"):
        pt._core.law_transfer_function((name, [*numbers, 1.0, 2.0]), 0.02)


def test_an_unknown_law_is_refused_with_all_names() -> None:
    with pytest.raises(ParameterError, match=f"law is 'pdi': expected '{LAWS[0]}'.*'{LAWS[-1]}'"):
        pt._core.law_transfer_function(("pdi", [1.0]), 0.02)


@pytest.mark.parametrize("name", LAWS)
def test_a_law_is_named_where_people_look_for_it(name: str) -> None:
    header = (ROOT / "rust" / "capi" / "include" / "piezotrack.h").read_text(encoding="utf-8")
    assert f'| "{name}" |' in header


@pytest.mark.parametrize("law", SOUGHT)
def test_a_law_that_is_sought_is_one_of_the_list(law: str) -> None:
    settings = dict.fromkeys(("kp", "ki", "kd"), 1e4) | {"switching": 3.0, "observer": 2.0}
    settings |= {"lead_time": 0.1, "lag_time": 0.3, "damping": 1e5, "damping_velocity": -1e4}
    settings |= {"damping_frequency": 9.0, "damping_ratio": 0.5}
    found = law_of(law, settings, 0.02, 1.0, Nominal(1.5e-6, 0.01))
    assert found.info.name == ("pid" if law in ("pi", "pd") else law)
    assert found.info.name in LAWS


def test_a_law_by_h_infinity_is_kept_as_one_in_state_space(tmp_path: Path) -> None:
    law = pt.control.MixedSensitivity([[1.0]], [2e3], [1.0], gamma=0.9, bandwidth=10.0)
    loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=law)
    again = pt.load_controller(loop.save(tmp_path / "loop.json"))
    assert type(again.feedback) is pt.control.StateSpace
    assert again.feedback._settings == law._settings


def test_numbers_of_single_precision_are_taken_as_doubles() -> None:
    gain: Any = np.float32(0.1e6)
    time: Any = np.float32(0.1)
    law = pt.Pid(kp=gain, ti=time)
    assert (law.kp, law.ti) == (0.1e6, float(np.float32(0.1)))
    assert {type(law.kp), type(law.ti)} == {float}
