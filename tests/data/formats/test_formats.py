"""The list of formats: extras, the page, and what is said where a library is not installed."""

from __future__ import annotations

import re
import sys
import tomllib
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from folders import ROOT
from format_logs import T, U, Y, is_the_log, refusal
from piezotrack.data.formats import FORMATS

if TYPE_CHECKING:
    from pathlib import Path

FOLDER = ROOT / "python" / "piezotrack" / "data" / "formats"
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
    "optional-dependencies"
]
PAGE = (ROOT / "docs" / "logs.md").read_text(encoding="utf-8")

# The first bytes of a file, its name, the library and the extra.
NEEDED = {
    "hdf5": (b"\x89HDF\r\n\x1a\n", "log.h5", "h5py", "hdf5"),
    "mat": (b"MATLAB 7.3 MAT-file", "log.mat", "h5py", "mat"),
    "tdms": (b"TDSm", "log.tdms", "nptdms", "tdms"),
    "parquet": (b"PAR1", "log.parquet", "pyarrow", "parquet"),
    "mdf": (b"MDF     4.10    ", "log.mf4", "asammdf", "mdf"),
    "afm": (b"PK\x03\x04", "log.jpk-force", "afmformats", "afm"),
    "xlsx": (b"PK\x03\x04", "log.xlsx", "openpyxl", "xlsx"),
}


@pytest.mark.parametrize("name", NEEDED)
def test_a_library_that_is_missing_is_named_with_its_extra(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content, file, library, extra = NEEDED[name]
    (tmp_path / file).write_bytes(content + bytes(100))
    for module in [one for one in sys.modules if one.partition(".")[0] == library]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, library, None)
    assert refusal(tmp_path / file) == (
        f"{file}: is read with {library}, which is not installed: expected "
        f"pip install 'piezotrack[{extra}]'"
    )
    assert any(library in need.lower() for need in EXTRAS[extra])


def test_what_is_written_with_a_library_names_it_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    log = pt.Dataset(u=U, y=Y / 1e6, t=T)
    with pytest.raises(pt.DataError, match=r"pip install 'piezotrack\[parquet\]'"):
        log.save(tmp_path / "log.parquet")
    assert list(tmp_path.iterdir()) == []


def test_every_extra_of_a_format_is_in_the_one_of_all() -> None:
    (every,) = EXTRAS["formats"]
    named = set(re.findall(r"\w+", every.partition("[")[2]))
    assert named == {extra for *_, extra in NEEDED.values()}


def test_every_file_of_a_format_is_in_the_list_and_on_the_page() -> None:
    files = [path for path in FOLDER.rglob("*.py") if "Format(" in path.read_text(encoding="utf-8")]
    # NPZ and NPY are one file.
    assert len(FORMATS) == len(files) + 1
    for known in FORMATS:
        assert any(ending in PAGE for ending in known.endings) or known.name in PAGE


@pytest.mark.parametrize("ending", [".h5", ".tdms", ".parquet", ".npz", ".mat", ".mf4"])
def test_a_text_with_the_ending_of_another_format_is_refused(tmp_path: Path, ending: str) -> None:
    libraries = {".h5": "h5py", ".tdms": "nptdms", ".parquet": "pyarrow", ".mf4": "asammdf"}
    pytest.importorskip(libraries.get(ending, "numpy"))
    path = tmp_path / f"log{ending}"
    path.write_text("time_s,voltage_V,x_um\n0,1,2\n1,2,3\n2,1,2\n", encoding="utf-8")
    found = refusal(path)
    assert "is not a" in found


def test_importing_the_reader_imports_none_of_the_libraries() -> None:
    from children import child

    done = child(
        "import sys; import piezotrack.data.reader\n"
        "print([m for m in ('h5py', 'nptdms', 'pyarrow', 'asammdf', 'afmformats', 'scipy.io') "
        "if m in sys.modules])"
    )
    assert done.stdout.strip() == "[]"


def test_an_archive_by_another_name_is_read(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", time_s=T, voltage_V=U, displacement_um=Y)
    (tmp_path / "log.npz").rename(tmp_path / "log.bak")
    assert is_the_log(pt.read(tmp_path / "log.bak"))
