"""Bad logs of every format: each is refused with its file and what was expected."""

from __future__ import annotations

import re
from contextlib import nullcontext
from pathlib import Path

import pytest

import piezotrack as pt
from bad_logs import KINDS, Case, Kind, cases, without
from folders import ROOT
from log_writers import text
from piezotrack.data.formats import FORMATS

ANY = Kind("Any format", "log.csv", text)
NOT_THERE = [
    (ANY, Case("there is no such file", Path.absolute, "data/log.csv")),
    (ANY, Case("a folder", Path.mkdir, "data")),
]
BAD = [*NOT_THERE, *((kind, case) for kind in KINDS for case in cases(kind))]
# Beside "expected": what a person has to do, or what a field is not.
REMEDIES = (
    "expected",
    "no such file",
    "name it with",
    "choose one with",
    "units=",
    "the columns are",
    "is not a",
)


@pytest.mark.parametrize(
    ("kind", "case"), BAD, ids=[f"{kind.name}: {case.wrong}" for kind, case in BAD]
)
def test_a_bad_log_is_refused_with_its_file_and_what_was_expected(
    kind: Kind, case: Case, tmp_path: Path
) -> None:
    for library in (kind.library, "hdf5storage" if kind.name == "MAT v7.3" else ""):
        if library:
            pytest.importorskip(library)
    path = tmp_path / (case.file or kind.file)
    case.make(path)
    with (
        without(case.missing) if case.missing else nullcontext(),
        pytest.raises((pt.DataError, pt.ParameterError)) as raised,
    ):
        pt.read(path, **dict(case.arguments))
    file, colon, rest = str(raised.value).replace(f"{tmp_path}/", "").partition(": ")
    assert colon
    assert re.fullmatch(r"[\w./-]+(:\d+)?", file)
    assert any(remedy in rest for remedy in REMEDIES), rest
    # No other folder of this machine.
    assert str(tmp_path) not in rest
    assert str(ROOT) not in rest


def test_every_format_that_is_read_has_bad_logs() -> None:
    files = [case.file or kind.file for kind, case in BAD]
    for known in FORMATS:
        assert not known.endings or any(one.endswith(known.endings) for one in files), known.name
