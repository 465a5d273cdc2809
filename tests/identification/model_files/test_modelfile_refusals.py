"""Model files that others have changed: refused in words, or read."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

import pytest

import piezotrack as pt
from records import published, quick

if TYPE_CHECKING:
    from pathlib import Path


def changed(*where: str, to: Any = None, drop: bool = False) -> bytes:
    """The published model with one entry changed or dropped."""
    document: dict[str, Any] = json.loads(json.dumps(published().document()))
    entry = document
    for name in where[:-1]:
        entry = entry[name]
    if drop:
        del entry[where[-1]]
    else:
        entry[where[-1]] = to
    return json.dumps(document).encode()


HEAD = '{"format": "piezotrack-model", '

BAD: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "Expecting value; expected a file that piezotrack saved, as a model"),
    "text": (b"time_s,voltage_V\n0,1\n", "dahl.json:1: not JSON"),
    "a comma too many": (b'{\n"format": 1,\n}', "dahl.json:3: not JSON"),
    "cut off": (changed("stroke", "value", to=1.0)[:400], "dahl.json:1: not JSON"),
    "binary": (bytes(range(256)), "dahl.json is not a text file: expected JSON"),
    "PNG": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "dahl.json is not a text file"),
    "NUL": (b"\0" * 64, "dahl.json:1: not JSON"),
    "UTF-16": ("{}".encode("utf-16"), "dahl.json is not a text file"),
    "other JSON": (b'{"a": 1}', "dahl.json is not a piezotrack model"),
    "a list": (b"[]", "dahl.json is not a piezotrack model"),
    "a number": (b"5", "dahl.json is not a piezotrack model"),
    "deep lists": (b"[" * 100_000, "dahl.json"),
    "a number of 5000 digits": ((HEAD + f'"x": {"9" * 5000}}}').encode(), "dahl.json"),
    "a newer version": (
        changed("schema_version", to=3),
        "dahl.json: schema_version is 3: expected 1 to 2, which this version",
    ),
    "no version": (changed("schema_version", drop=True), "dahl.json: schema_version is None"),
    "another model": (changed("model", to="maxwell"), "dahl.json holds a model 'maxwell'"),
    "no parameters": (changed("parameters", drop=True), "'parameters' is missing"),
    "no mass": (changed("parameters", "mass", drop=True), "'mass' is missing"),
    "no value": (changed("parameters", "mass", "value", drop=True), "'value' is missing"),
    "no offset": (changed("offset", drop=True), "'offset' is missing"),
    "no stroke": (changed("stroke", drop=True), "'stroke' is missing"),
    "no scale_assumed": (changed("scale_assumed", drop=True), "'scale_assumed' is missing"),
    "parameters in a list": (changed("parameters", to=[]), "dahl.json: an entry is not of"),
    "a bare offset": (changed("offset", to=1e-6), "dahl.json: an entry is not of the form"),
    "a negative mass": (changed("parameters", "mass", "value", to=-1.0), "mass is -1 kg"),
    "a mass in words": (changed("parameters", "mass", "value", to="light"), "mass is 'light'"),
    "no mass known": (changed("parameters", "mass", "value", to=None), "mass is None"),
    "NaN": (changed("parameters", "a1", "value", to=math.nan), "a1 is NaN"),
    "b0 of infinity": (changed("parameters", "b0", "value", to=math.inf), "b0 is inf"),
    "a negative delay": (changed("delay", "value", to=-1e-3), "delay is -0.001 s"),
    "a delay in ms": (changed("delay", "unit", to="ms"), "unit of delay"),
    "another unit": (changed("parameters", "mass", "unit", to="g"), "unit"),
    "an offset in um": (changed("offset", "unit", to="um"), "unit"),
    "an offset of NaN": (changed("offset", "value", to=math.nan), "offset"),
    "no stroke to speak of": (changed("stroke", "value", to=0.0), "stroke"),
    "a stroke of NaN": (changed("stroke", "value", to=math.nan), "stroke"),
    "an offset of a metre": (
        changed("offset", "value", to=-1e300),
        "offset is -1e+300 m: expected a finite number between -1 and 1",
    ),
    "a delay of ages": (
        changed("delay", "value", to=1e300),
        "delay is 1e+300 s: expected a finite number from 0 to 1000",
    ),
    "an offset of 400 digits": (changed("offset", "value", to=10**400), "dahl.json: "),
    "a mass of 400 digits": (changed("parameters", "mass", "value", to=10**400), "dahl.json: "),
    "a name twice": (
        changed("note", to=1).replace(b'"note": 1', b'"offset": 1'),
        "the entry 'offset' is there twice: expected it once",
    ),
    "fitted in words": (changed("offset", "fitted", to="false"), "fitted"),
    "scale_assumed in words": (changed("scale_assumed", to="no"), "scale_assumed"),
}


@pytest.mark.parametrize("name", BAD)
def test_refuses_a_bad_file(tmp_path: Path, name: str) -> None:
    content, message = BAD[name]
    path = tmp_path / "dahl.json"
    path.write_bytes(content)
    with pytest.raises(pt.DataError) as caught:
        pt.load(path)
    assert str(caught.value).startswith("dahl.json")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def origin(**data: Any) -> bytes:
    return changed("provenance", to={"data": data})


BAD_ORIGIN = {
    "a number": (changed("provenance", to=5), "provenance is 5: expected an object"),
    "a list": (changed("provenance", to=[1]), "provenance is [1]: expected an object"),
    "a text": (changed("provenance", to="x" * 100), '"xxx'),
    "data is a list": (changed("provenance", to={"data": [1]}), "data is [1]: expected an object"),
    "one number": (origin(drive_range=[1.0]), "drive_range is [1.0]: expected two numbers"),
    "a number as range": (origin(drive_range=5), "drive_range is 5: expected two numbers"),
    "reversed": (origin(drive_range=[2, 1]), "drive_range is [2, 1]: expected two numbers, the"),
    "texts": (origin(drive_range=["a", "b"]), 'drive_range is ["a", "b"]: expected two numbers'),
    "NaN": (origin(drive_range=[math.nan, 1.0]), "drive_range is [NaN, 1.0]: expected two"),
    "truth": (origin(drive_range=[False, True]), "drive_range is [false, true]: expected two"),
    "digits": (origin(drive_range=[0, 10**400]), "drive_range is [0, 1"),
    "a window": (origin(window_s={"a": 1}), 'window_s is {"a": 1}: expected two numbers'),
    "a source": (origin(source=[1]), "source is [1]: expected a text or null"),
}


COVARIANCE: dict[str, Any] = {
    "names": ["mass", "a1"],
    "matrix": [[1.0], [0.5, 2.0]],
    "values": [0.2, 1.0],
    "determined": [True, True],
    "independent": [1.0, 1.0],
    "factors": [1.0, 1.0],
    "widening": [1.0, 1.0],
    "shifts": [[0.0, 1.0], [0.0, 1.0]],
    "to_least_cost": [0.0, 0.0],
    "samples": 100,
    "orders": [2],
    "hidden": [],
    "predicted": {"value": 1e-7, "unit": "m"},
}


@pytest.mark.parametrize(
    ("entry", "to", "message"),
    [
        ("matrix", [[1.0], [0.5]], "covariance: matrix has 2 rows: expected the lower triangle"),
        ("matrix", [[1.0], [None, 2.0]], "covariance: matrix has null: expected finite numbers"),
        ("matrix", [[-1.0], [0.5, 2.0]], "covariance: matrix has a variance below 0"),
        ("values", [0.2], "covariance: values has another form: expected 2 numbers"),
        ("factors", [1.0, "<script>"], "covariance: factors has another form: expected 2 numbers"),
        ("shifts", [[0.0, 1.0], [0.0]], "covariance: shifts has another form: expected 2 x 2"),
        ("hidden", [[1.0]], "covariance: hidden has another form: expected any x 2 numbers"),
        ("samples", -1, "covariance: samples is -1"),
        (
            "names",
            ["mass", "weights[1]"],
            "covariance: names has 'weights[1]': expected numbers of",
        ),
        ("names", None, "an entry is not of the form that 'save' writes"),
    ],
)
def test_refuses_a_covariance_of_another_form(
    tmp_path: Path, entry: str, to: object, message: str
) -> None:
    path = tmp_path / "dahl.json"
    path.write_bytes(changed("covariance", to=COVARIANCE))
    assert pt.load(path).covariance is not None
    path.write_bytes(changed("covariance", to={**COVARIANCE, entry: to}))
    with pytest.raises(pt.DataError, match=r"^dahl\.json: ") as caught:
        pt.load(path)
    assert message in str(caught.value)


@pytest.mark.parametrize("name", BAD_ORIGIN)
def test_refuses_a_bad_origin(tmp_path: Path, name: str) -> None:
    content, message = BAD_ORIGIN[name]
    (tmp_path / "dahl.json").write_bytes(content)
    with pytest.raises(pt.DataError, match=r"^dahl\.json: provenance") as caught:
        pt.load(tmp_path / "dahl.json")
    assert message in str(caught.value)
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize(
    "content",
    [
        changed("provenance", to=None),
        changed("provenance", to={}),
        changed("provenance", to={"data": None}),
        origin(drive_range=None, window_s=None, source=None),
        changed("parameters", "later", to={"free": True}),
    ],
)
def test_a_file_may_lack_the_origin_of_its_numbers(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "dahl.json"
    path.write_bytes(content)
    model = pt.load(path)
    assert model.drive_range is None
    assert model.window_on(quick()) is None
    assert not model.fitted_on(quick())
    assert model.free_count in (None, 1)


def test_a_byte_order_mark_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "dahl.json"
    path.write_bytes(b"\xef\xbb\xbf" + changed("note", to="x"))
    assert pt.load(path).model == published().model


def test_refuses_what_is_not_there(tmp_path: Path) -> None:
    # Of a wrong folder its name is needed, as pt.read gives it.
    with pytest.raises(pt.DataError, match=r"^gone\.json: there is no such file in '.*elsewhere'"):
        pt.load(tmp_path / "elsewhere" / "gone.json")
    with pytest.raises(pt.DataError, match="is a directory"):
        pt.load(tmp_path)
    # As pt.read does.
    with pytest.raises(pt.DataError, match=r"b\.json"):
        pt.load(tmp_path / "a\0b.json")
    with pytest.raises(pt.ParameterError, match="path is None"):
        pt.load(None)  # type: ignore[arg-type]


def test_what_others_added_to_the_file_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "dahl.json"
    path.write_bytes(changed("note", to="left stage, cold"))
    back = pt.load(path)
    assert json.loads(back.save(path).read_text())["note"] == "left stage, cold"
