"""The report of a stage: one file that loads nothing, the same bytes, the call repeats it."""

from __future__ import annotations

import base64
import datetime
import hashlib
import re
import xml.etree.ElementTree as ET
from functools import cache
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from matplotlib.figure import Figure

import piezotrack as pt
from piezotrack._support.display.result import Result
from piezotrack._support.page.parts import Picture
from piezotrack._support.page.pdf import _fitted, _width, _wrapped
from piezotrack._support.units import decibels
from piezotrack.errors import DataError, ParameterError
from piezotrack.identification.views.report_page.again import python_call
from piezotrack.identification.views.report_page.page import report_page

if TYPE_CHECKING:
    from pathlib import Path

DAY = datetime.date(2020, 2, 29)
LOG = pt.datasets.dbo_training()
FEW = pt.LeastSquares(count=4, creep=False, dynamics=None)


@cache
def plays() -> pt.identification.Identification:
    return pt.identify(LOG[3.0:8.0], "prandtl-ishlinskii", method=FEW, progress=False)


@cache
def dahl() -> pt.identification.Identification:
    few = pt.Descents(samples=4, starts=2, agreeing=2, rounds=1, seed=3)
    held: dict[str, Any] = {
        "stiffness": 2e5,
        "a1": (100.0, 1e4),
        "b0": pt.Parameter(prior=(0.0, 1.0)),
    }
    return pt.identify(
        LOG[3.0:5.0], "dahl", parameters=held, constraints=["a1 < a2"], delay=1e-4, method=few,
        progress=False,
    )  # fmt: skip


@cache
def several() -> pt.identification.Identification:
    records = [pt.Record(LOG[3.0:6.0], weight=2.0), pt.Record(LOG[6.0:9.0], offset=False)]
    return pt.identify(records, "prandtl-ishlinskii", method=FEW, progress=False)


class Drive(Result):
    """Stand-in for a suggested drive."""

    def summary(self) -> str:
        return "0 to 3.6 V & up\n\na table"

    def plot(self, *, fig: Any = None, **look: Any) -> Figure:
        assert not look
        fig.subplots().plot([0.0, 1.0])
        return fig  # type: ignore[no-any-return]


class Elements(HTMLParser):
    """Elements that are open, which have to be closed in turn, and all that have been there."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs)))
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def written(fit: Any, file: Path, **options: Any) -> bytes:
    return fit.report(file, date=DAY, **options).read_bytes()  # type: ignore[no-any-return]


@pytest.mark.parametrize("fit", [plays, dahl, several])
def test_the_page_is_whole_and_loads_nothing(fit: Any, tmp_path: Path) -> None:
    text = written(fit(), tmp_path / "report.html").decode()
    page = Elements(text)
    assert not page.open
    assert not {"script", "link", "iframe", "object"} & {tag for tag, _ in page.seen}
    sources = [attrs[key] for _, attrs in page.seen for key in ("src", "href") if key in attrs]
    assert len(sources) == 3
    for source in sources:
        head, _, content = str(source).partition(",")
        assert head == "data:image/svg+xml;base64"
        drawing = base64.b64decode(content).decode()
        ET.fromstring(drawing)
        # Names of namespaces are no addresses; what is drawn refers to its own parts only.
        assert not re.search(r'(?:href|src)="(?!#|data:)|url\((?!#)', drawing)
    assert not re.search(r"@import|url\(", text.split("</style>")[0])
    assert "2020-02-29" in text


@pytest.mark.parametrize("ending", ["html", "pdf"])
def test_the_same_fit_gives_the_same_bytes(ending: str, tmp_path: Path) -> None:
    first = written(dahl(), tmp_path / f"a.{ending}")
    # The solver of the layout depends on addresses in memory.
    for _ in range(2):
        assert written(dahl(), tmp_path / f"b.{ending}") == first
    other = dahl().report(tmp_path / f"c.{ending}", date=datetime.date(2021, 1, 1)).read_bytes()
    assert other != first


@pytest.mark.parametrize("fit", [plays, several])
def test_the_pdf_has_pages(fit: Any, tmp_path: Path) -> None:
    data = written(fit(), tmp_path / "report.PDF")
    assert data.startswith(b"%PDF")
    assert 2 <= len(re.findall(rb"/Type /Page\b", data)) <= 4


def test_the_hashes_are_those_of_record_and_model_file(tmp_path: Path) -> None:
    text = written(plays(), tmp_path / "report.html").decode()
    model = plays().save(tmp_path / "model.json")
    assert hashlib.sha256(model.read_bytes()).hexdigest() in text
    assert LOG[3.0:8.0].sha256 in text


@pytest.mark.parametrize("fit", [plays, dahl, several])
def test_the_call_repeats_the_fit_to_the_bit(fit: Any, tmp_path: Path) -> None:
    names: dict[str, Any] = {}
    exec(python_call(fit()), names)
    again = names["fit"]
    assert again.model == fit().model
    assert again.cost == fit().cost
    assert written(again, tmp_path / "again.html") == written(fit(), tmp_path / "first.html")


def test_arguments_are_kept_in_the_model_file(tmp_path: Path) -> None:
    loaded = pt.load(dahl().save(tmp_path / "dahl.json"))
    given = loaded.details["provenance"]["arguments"]
    assert given["parameters"]["a1"] == {"bounds": [100.0, 1e4]}
    assert given["constraints"] == ["a1 < a2"]
    assert given["delay"] == 1e-4
    # A call without any has no such entry.
    assert "arguments" not in plays().details["provenance"]


def test_the_interval_is_that_of_the_covariance() -> None:
    (table,) = (
        part
        for section in report_page(dahl(), date=DAY).sections
        for part in section.parts
        if section.title == "Parameters"
    )
    rows = {row[1]: row for row in table.rows}  # type: ignore[union-attr]
    covariance = dahl().covariance
    assert covariance is not None
    interval = tuple(map(float, str(rows["D"][3]).split(" to ")))
    assert interval == pytest.approx(covariance.interval("damping"), rel=1e-3)
    assert rows["K"][3] == ""


def test_controller_and_suggestion_are_shown(tmp_path: Path) -> None:
    tuned = pt.tune(
        pt.VirtualStage.of(plays().zeroed()), dt=0.005, limits=(0.0, 3.6),
        parts=["pid"], search=pt.TuningSearch(seed=1, particles=8, iterations=4),
    )  # fmt: skip
    text = written(plays(), tmp_path / "report.html", controller=tuned, suggestion=Drive()).decode()
    assert text.index("0 to 3.6 V &amp; up") < text.index("gain margin")
    assert f"gain margin {decibels(tuned.kept[0].value):.3g} dB" in text
    assert text.index("gain margin") < text.index("sha256")


@pytest.mark.parametrize("name", ["report.docx", "report", "report.html.gz"])
def test_another_ending_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"\.html or \.pdf") as refused:
        plays().report(tmp_path / name)
    assert name in str(refused.value)
    assert not list(tmp_path.iterdir())


def test_other_bad_arguments_are_refused(tmp_path: Path) -> None:
    for argument in ({"controller": 3}, {"suggestion": plays}, {"date": "2020-02-29"}):
        with pytest.raises(ParameterError, match=next(iter(argument))):
            plays().report(tmp_path / "report.html", **argument)
    with pytest.raises(DataError, match="cannot be written"):
        plays().report(tmp_path / "missing" / "report.html")


def test_a_failure_keeps_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old = written(plays(), tmp_path / "report.pdf")

    def fail(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Figure, "savefig", fail)
    with pytest.raises(DataError, match="no space left"):
        plays().report(tmp_path / "report.pdf")
    assert [one.name for one in tmp_path.iterdir()] == ["report.pdf"]
    assert (tmp_path / "report.pdf").read_bytes() == old


def test_names_of_files_are_shown_as_they_are(tmp_path: Path) -> None:
    t = np.arange(1000) / 200.0
    u = 30.0 - 30.0 * np.cos(2.0 * np.pi * t)
    log = pt.Dataset(u=u, y=1e-6 * u, dt=0.005, source="<b>$x_$ & \x07.csv")
    fit = pt.identify(log, "prandtl-ishlinskii", method=FEW, progress=False)
    text = written(fit, tmp_path / "report.html").decode()
    assert "&lt;b&gt;$x_$ &amp; " in text
    assert "<b>" not in text
    assert written(fit, tmp_path / "report.pdf").startswith(b"%PDF")


def test_no_more_than_four_records_are_drawn() -> None:
    logs = [LOG[3.0 + i : 4.0 + i] for i in range(6)]
    fit = pt.identify(logs, "prandtl-ishlinskii", method=FEW, progress=False)
    drawn = [
        part.name
        for section in report_page(fit, date=DAY).sections
        for part in section.parts
        if isinstance(part, Picture)
    ]
    worst = sorted(range(6), key=lambda i: -fit.records[i].cost_percent)[:4]
    assert drawn == [*(f"record-{i + 1}" for i in sorted(worst)), "residual"]


def test_lines_and_columns_fit_the_page() -> None:
    text = f"a {'w' * 300} of some words that go on " * 5
    lines = _wrapped(text, 3.0, 9.0, "normal")
    assert max(_width(one, 9.0, "normal") for one in lines) <= 3.0
    assert "".join(lines).replace(" ", "") == text.replace(" ", "")
    assert _fitted([1.0, 5.0, 9.0], 7.0) == [1.0, 3.0, 3.0]
    assert _fitted([1.0, 2.0], 7.0) == [1.0, 2.0]
