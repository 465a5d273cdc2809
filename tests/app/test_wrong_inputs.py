"""Numbers and texts that no stage has: one sentence each, and the control stays to mend it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from page.window import Window
from piezotrack.app.device import DeviceProcess
from piezotrack.app.steps import model
from piezotrack.stages.registry import MODELS

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(scope="module")
def window() -> Iterator[Window]:
    with pytest.MonkeyPatch.context() as patch:
        kinds = tuple(one for one in MODELS if one.name == "duhem")
        patch.setattr(model, "MODELS", kinds)
        device = DeviceProcess("virtual:")
        made = Window(device)
        made.do("log.example")
        made.do("go", to="model")
        made.finish()
        made.do("go", to="loop")
        made.finish()
        yield made
        made.session.close()
        device.close()


AT_ONCE: list[tuple[str, str, float | str]] = [
    ("log", "dt", -1.0),
    ("log", "resample", -1.0),
    ("log", "decimate", 0),
    ("model", "seed", -1),
    ("model", "share", 0.0),
    ("model", "share", 60.0),
    ("motion", "frequency", 0.0),
    ("motion", "frequency", -1.0),
    ("motion", "steps", 0),
    ("loop", "kp", 0.0),
    ("loop", "kp", -1.0),
    ("loop", "kd", -1.0),
    ("loop", "low_pass", -3.0),
    ("loop", "delay", -1.0),
    ("loop", "noise", -1.0),
    ("loop", "spread", -1.0),
    ("device", "rate", 0.0),
    ("device", "frequency", -1.0),
    ("device", "trials", 0),
    ("device", "cutoff", -1.0),
    ("use", "name", "2 stages"),
    ("use", "name", ""),
]
WRONG: list[tuple[str, dict[str, Any], str, str]] = [
    # Step, values, the control that has to stay, and a word of the sentence.
    ("log", {"window": [5.0, 5.0]}, "hold", "empty"),
    ("log", {"window": [100.0, 200.0]}, "hold", "out of the record"),
    ("log", {"decimate": 100_000}, "hold", "factor"),
    ("model", {"test_from": 1000.0}, "test_from", "empty"),
    ("motion", {"frequency": 1e6}, "frequency", "shortest period"),
    ("motion", {"frequency": 1e-9}, "frequency", "samples"),
    ("motion", {"low": 0.0, "high": -1e-6}, "low", "less than high"),
    ("motion", {"low": 1.0}, "low", "low is 1"),
    ("motion", {"kind": "file"}, "motion", "no file yet"),
    ("loop", {"kp": 1e12}, "kp", "kp is 1e+12"),
    ("loop", {"notch": 1e5}, "notch", "half the sampling rate"),
    ("loop", {"low_pass": 1e5}, "low_pass", "half the sampling rate"),
    ("loop", {"delay": 10.0}, "delay", "delay is 10"),
    ("device", {"low": -10.0}, "low", "low is -10 V"),
    ("device", {"high": 1e6}, "high", "high is 1e+06 V"),
    ("device", {"low": 75.0}, "low", "low is 75 V"),
]


@pytest.mark.parametrize(("step", "name", "value"), AT_ONCE)
def test_what_is_out_of_range_is_refused_at_once(
    window: Window, step: str, name: str, value: float | str
) -> None:
    before = window.desk.state
    error = window.set(step, **{name: value})["error"]
    assert error["control"] == name
    shown = repr(value) if isinstance(value, str) else f"{value:g}"
    assert f"{name} is {shown}" in error["text"]
    assert window.desk.state == before


@pytest.mark.parametrize(("step", "values", "control", "word"), WRONG)
def test_a_sentence_beside_the_control(
    window: Window, step: str, values: dict[str, Any], control: str, word: str
) -> None:
    page = "use" if step == "device" else step
    window.do("go", to=page)
    window.finish()
    window.set(step, **values)
    window.finish()
    answer, _ = window.do("whole")
    shown = [window.parts[key] for key in answer["order"]]
    items = [one["name"] for part in shown if part["kind"] == "controls" for one in part["items"]]
    texts = [one["text"] for part in shown if part["kind"] == "messages" for one in part["items"]]
    window.do("undo")
    window.finish()
    assert control in items
    found = [text for text in texts if word in text]
    assert len(found) == 1, texts
    assert "\n" not in found[0]
    assert not any("piezotrack itself" in text for text in texts)


def test_no_gain_of_the_integral_is_a_loop_too(window: Window) -> None:
    window.do("go", to="loop")
    window.set("loop", ki=0.0)
    window.finish()
    answer, _ = window.do("whole")
    assert "loop.l-nyquist" in answer["order"]
    assert "loop.fault" not in answer["order"]
    window.do("undo")
