"""Results in a notebook: tables, and progress that leaves nothing."""

from __future__ import annotations

import sys
import types
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

import numpy as np

import piezotrack as pt
from piezotrack._support.display import progress_bar
from piezotrack._support.display.progress_bar import ProgressBar

if TYPE_CHECKING:
    from pathlib import Path

    import pytest


class Cells(HTMLParser):
    """Texts of the cells of tables."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.cells: list[str] = []
        self._inside = False
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        del attrs
        self._inside = tag in ("th", "td")
        self.cells += [""] * self._inside

    def handle_endtag(self, tag: str) -> None:
        self._inside = self._inside and tag not in ("th", "td")

    def handle_data(self, data: str) -> None:
        if self._inside:
            self.cells[-1] += data


def cells(value: Any) -> list[str]:
    return Cells(value._repr_html_()).cells


def record() -> pt.Dataset:
    u = 20.0 - 20.0 * np.cos(np.arange(1000) / 50.0)
    return pt.Dataset(u=u, y=1e-6 * u + 1e-7 * np.sin(np.arange(1000) / 50.0), dt=0.005)


def test_a_score_is_a_table() -> None:
    log = record()
    score = pt.identify(log, "prandtl-ishlinskii", progress=False).score(log)
    shown = cells(score)
    assert f"{1e6 * score.rms:.4g} \N{MICRO SIGN}m" in shown[shown.index("rms error") + 1]
    assert shown[shown.index("record") + 1] == "fitted"


def test_metrics_are_a_table_in_micrometres_and_degrees() -> None:
    stage = pt.DahlStage.xu_li_2010()
    loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedforward=stage.inverse())
    reference = pt.sine(frequency=0.5, low=10e-6, high=50e-6, duration=4.0)
    metrics = pt.track(stage, loop, reference).metrics
    shown = cells(metrics)
    assert shown[shown.index("rms") + 1] == f"{1e6 * metrics.rms_error:.4g} \N{MICRO SIGN}m"
    assert metrics.phase_lag is not None
    degrees = np.degrees(metrics.phase_lag)
    assert shown[shown.index("phase lag") + 1] == f"{degrees:.3g}\N{DEGREE SIGN}"
    assert repr(metrics) == f"<Metrics, {metrics}>"


def test_the_contents_of_a_log_are_two_tables_and_one_line(tmp_path: Path) -> None:
    path = record().save(tmp_path / "log & more.csv")
    found = pt.data.info(path)
    shown = cells(found)
    assert "voltage_V" in shown
    assert shown[shown.index("rate") + 1] == "200 Hz, even"
    assert shown.count("can determine") == len(found.determines)
    assert repr(found).startswith("<LogInfo, log & more.csv: CSV, 3 columns, 1000 samples, 200 Hz")
    assert len(repr(found).splitlines()) == 1
    assert str(found) == found.summary()


def test_loops_and_tuned_controllers_show_their_text() -> None:
    stage = pt.VirtualStage.xu_li_2010(seed=1)
    loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
    report = pt.check_loop(stage, loop)
    assert report.summary().splitlines()[0] in report._repr_html_()
    assert len(repr(report).splitlines()) == 1
    few = pt.TuningSearch(particles=8, iterations=3)
    tuned = pt.tune(stage, dt=0.02, limits=(0.0, 75.0), parts=["pid"], search=few)
    assert "bandwidth" in tuned._repr_html_()
    assert len(repr(tuned).splitlines()) == 1


class Handle:
    """Place of an output in a cell."""

    def __init__(self, shown: list[Any]) -> None:
        self.shown = shown

    def update(self, bundle: Any, *, raw: bool) -> None:
        assert raw
        self.shown.append(bundle)


def test_progress_in_a_notebook_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Any] = []

    def display(bundle: Any, *, raw: bool, display_id: bool) -> Handle:
        assert raw
        assert display_id
        shown.append(bundle)
        return Handle(shown)

    module = types.ModuleType("IPython.display")
    vars(module)["display"] = display
    monkeypatch.setitem(sys.modules, "IPython.display", module)
    place = types.SimpleNamespace(is_jupyter=True, is_terminal=True)
    monkeypatch.setattr(progress_bar, "console", lambda: place)
    # What takes no time shows nothing.
    with ProgressBar(None, "identify: dahl") as bar:
        bar.step(1, 2, "half")
    assert shown == []
    monkeypatch.setattr(progress_bar, "SOON", 0.0)
    monkeypatch.setattr(progress_bar, "OFTEN", 0.0)
    with ProgressBar(None, "identify: dahl") as bar:
        bar.step(1, 2, "20 seeds")
    assert "identify: dahl" in shown[-2]["text/plain"]
    assert "20 seeds" in shown[-2]["text/plain"]
    assert shown[-1] == {"text/html": ""}
