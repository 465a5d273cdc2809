"""The state of the page, and the session that changes it."""

from __future__ import annotations

import base64
import json
import threading
import time
import zlib
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from piezotrack._support.display.thinning import extremes, path_cells
from piezotrack.app.session import Session
from piezotrack.app.state import State
from piezotrack.errors import DataError, ParameterError


def test_a_state_is_read_back_from_its_file_and_its_link() -> None:
    state = State().changed("log", {"source": "a.csv", "window": [3.0, 23.0], "units.u": "V"})
    state = state.changed("loop", {"kp": 2.5e4, "speed": 1})
    assert State.read(json.dumps(state.document()).encode()) == state
    assert State.of_link(state.link()) == state
    assert state.log.units == {"u": "V"}
    assert state.changed("log", {"units.x": "um"}).log.units == {"u": "V", "x": "um"}


@pytest.mark.parametrize(
    ("step", "values"),
    [
        ("log", {"dt": True}),
        ("log", {"dt": "1"}),
        ("log", {"dt": float("nan")}),
        ("log", {"dt": 1e400}),
        ("log", {"window": [1.0]}),
        ("log", {"window": [1.0, None]}),
        ("log", {"source": "x" * 3000}),
        ("log", {"missing": "guess"}),
        ("log", {"decimate": 2.5}),
        ("log", {"units": {"u": 3}}),
        ("log", {"units": {str(i): "V" for i in range(300)}}),
        ("log", {"other": 1}),
        ("loop", {"repetitive": 1}),
        ("use", {"width": 86}),
        ("use", {"width": True}),
        ("nothing", {}),
    ],
)
def test_what_is_no_setting_is_refused_by_name(step: str, values: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match="expected") as caught:
        State().changed(step, values)
    name = next(iter(values), "nothing")
    assert name.partition(".")[0] in str(caught.value) or step == "nothing"


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\xff\xfe",
        b"[]",
        b"{}",
        b"[" * 100_000,
        b'{"format": "piezotrack-model"}',
        b'{"format": "piezotrack-state", "schema_version": 2}',
        b'{"format": "piezotrack-state", "schema_version": 1, "log": 3}',
        b'{"format": "piezotrack-state", "schema_version": 1, "step": "end"}',
    ],
)
def test_what_is_no_state_is_one_sentence(content: bytes) -> None:
    with pytest.raises((DataError, ParameterError), match="expected"):
        State.read(content)


def test_a_link_that_unpacks_to_a_gigabyte_is_none() -> None:
    bomb = base64.urlsafe_b64encode(zlib.compress(bytes(10**8), 9)).decode()
    begun = time.monotonic()
    with pytest.raises(DataError, match="state"):
        State.of_link(bomb)
    assert time.monotonic() - begun < 2.0


class Page:
    """A session whose first step waits until it is let go."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        from piezotrack.app.steps import PAGES

        self.answers: list[dict[str, Any]] = []
        self.free = threading.Event()
        self.free.set()
        self.shown: list[State] = []
        page = self

        class Waiting:
            title = "Log"

            def light(self, _: Any) -> tuple[str, str]:
                return "grey", ""

            def page(self, desk: Any) -> list[Any]:
                page.free.wait(10.0)
                page.shown.append(desk.state)
                return []

        monkeypatch.setitem(PAGES, "log", Waiting())
        self.session = Session(lambda answer, _: self.answers.append(answer))

    def send(self, **given: Any) -> None:
        self.session.take(given)

    def wait(self, seq: int) -> dict[str, Any]:
        until = time.monotonic() + 10.0
        while time.monotonic() < until:
            for answer in self.answers:
                if answer["seq"] == seq:
                    return answer
            time.sleep(0.002)
        raise AssertionError(f"no answer to {seq}")


def test_of_what_waits_the_latest_value_wins(monkeypatch: pytest.MonkeyPatch) -> None:
    page = Page(monkeypatch)
    page.free.clear()
    for i in range(50):
        page.send(do="set", step="log", values={"dt": 1.0 + i}, live=True, seq=i)
    page.free.set()
    assert page.wait(49)["error"] is None
    assert page.session.desk.state.log.dt == 50.0
    # The one that was being shown, and the last.
    assert len(page.shown) <= 3
    page.session.close()


def test_undo_goes_back_over_a_drag_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    page, seq = Page(monkeypatch), 0
    for value, live in ((1.0, False), (2.0, True), (3.0, True), (4.0, True)):
        seq += 1
        page.send(do="set", step="log", values={"dt": value}, live=live, seq=seq)
        page.wait(seq)
    for expected, do in ((1.0, "undo"), (None, "undo"), (None, "undo"), (1.0, "redo")):
        seq += 1
        page.send(do=do, seq=seq)
        page.wait(seq)
        assert page.session.desk.state.log.dt == expected
    page.session.close()


def test_an_error_keeps_the_state_and_names_its_control(monkeypatch: pytest.MonkeyPatch) -> None:
    page = Page(monkeypatch)
    page.send(do="set", step="log", values={"dt": 0.5}, seq=1)
    page.wait(1)
    page.send(do="set", step="log", values={"dt": "soon"}, seq=2)
    assert page.wait(2)["error"]["control"] == "dt"
    assert page.session.desk.state.log.dt == 0.5
    page.session.close()


def test_a_glitch_of_one_sample_is_drawn() -> None:
    values = np.random.default_rng(1).standard_normal(1_000_000)
    values[271_828], values[314_159] = 40.0, -40.0
    kept = extremes(values, 1600)
    assert kept.size < 1800
    assert {271_828, 314_159} <= set(kept.tolist())
    assert np.all(np.diff(kept) > 0)


def drawn(
    x: Any, y: Any, chosen: Any, count: int, box: tuple[float, float]
) -> set[tuple[int, int]]:
    """Cells that the line through the chosen samples goes through, by stepping along it."""
    low, wide = box
    cells: set[tuple[int, int]] = set()
    for a, b in pairwise(chosen):
        if a < 0 or b < 0:
            continue
        along = np.linspace(0.0, 1.0, 8)
        points = [np.asarray(v)[a] + along * (v[b] - v[a]) for v in (x, y)]
        i, j = (np.clip(((p - low) / wide * count).astype(int), 0, count - 1) for p in points)
        cells |= set(zip(i.tolist(), j.tolist(), strict=True))
    return cells


def test_a_loop_that_is_run_through_often_is_drawn_whole_and_once() -> None:
    count, turns, samples = 120, 40, 40_000
    angle = np.linspace(0.0, 2.0 * np.pi * turns, samples)
    x, y = np.cos(angle), np.sin(angle + 0.4)
    chosen = path_cells(x, y, count, count)
    assert chosen.size < samples // 10
    whole = drawn(x, y, np.arange(samples // turns + 2), count, (-1.0, 2.0))
    few = drawn(x, y, chosen, count, (-1.0, 2.0))
    # A chord from cell to cell may miss a corner.
    assert len(whole - few) < 0.05 * len(whole)
    assert all(min(abs(i - a) + abs(j - b) for a, b in whole) <= 2 for i, j in few)


def test_what_is_not_a_number_interrupts_a_line() -> None:
    x = np.array([0.0, 1.0, np.nan, 2.0, 3.0])
    assert path_cells(x, x, 100, 100).tolist() == [0, 1, -1, 3, 4]
