"""Files of every format, mutated: read to finite numbers, or refused in a sentence."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from file_readers import READERS, faults_of_file
from fuzzing import fuzz
from mutants import TABLES, binaries, binary_logs, documents, models, tables
from piezotrack.data.formats import apart
from soak import Script, Tally

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = [
    pytest.mark.slow,
    # A call stopped for its time may be stopped in a callback of Python's own, which says so.
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

# Each kind's share of the files.
SHARES = {"log": 5, "drive": 1, "reference": 1, "path": 1, "model": 5}
SHARES |= {ending: 1 for ending in READERS if ending.startswith(".")}
# What reads a format that is not text.
LIBRARIES = {
    ".mat": "h5py",
    ".parquet": "pyarrow",
    ".h5": "h5py",
    ".tdms": "nptdms",
    ".mf4": "asammdf",
}


@pytest.mark.parametrize("kind", READERS)
def test_a_mutated_file_is_read_or_refused(
    kind: str, request: pytest.FixtureRequest, record_property: Any, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    # Less than the fuzzers' own: a file that hangs its library is refused then.
    monkeypatch.setattr(apart, "PATIENCE", 4.0)
    tally = Tally(f"files: {kind}")
    if kind in LIBRARIES:
        pytest.importorskip(LIBRARIES[kind])
    if kind.startswith("."):
        mutants = binaries(binary_logs()[kind])
    else:
        mutants = documents(models()) if kind == "model" else tables(TABLES[kind])

    def body(_: Script, draw: Any) -> None:
        content = draw(mutants)
        faults, read = faults_of_file(kind, content)
        tally.tries += 1
        tally.accepted += read
        tally.refused += not read
        for fault in faults:
            tally.fail(fault, repr(content))

    files = int(request.config.getoption("--soak-files") * SHARES[kind] / sum(SHARES.values()))
    fuzz(tally, body, calls=files, start=request.config.getoption("--soak-seed"))
    record_property("tally", tally.row())
    tally.verdict()
