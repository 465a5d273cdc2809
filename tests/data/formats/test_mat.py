"""MAT v5 and v7, written by SciPy, and v7.3, written by hdf5storage as MATLAB does."""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from format_logs import DT, T, U, Y, is_the_log, refusal, survives
from log_writers import MAT_HEADER, mat_array, mat_element
from piezotrack.data.formats.binary.mat_elements import read_variables
from piezotrack.data.formats.source import Source

scipy_io = pytest.importorskip("scipy.io")

if TYPE_CHECKING:
    from pathlib import Path

PLAIN = {"time_s": T, "voltage_V": U, "displacement_um": Y}
STRUCTURE = {
    "log": {
        "time": T,
        "drive": U,
        "displacement": Y,
        "units": {"time": "s", "drive": "V", "displacement": "um"},
    }
}


def save(path: Path, variables: dict[str, Any], version: str) -> Path:
    if version == "7.3":
        storage = pytest.importorskip("hdf5storage")
        pytest.importorskip("h5py")
        storage.savemat(str(path), variables, format="7.3", matlab_compatible=True)
    else:
        scipy_io.savemat(path, variables, do_compression=version == "7")
    return path


versions = pytest.mark.parametrize("version", ["5", "7", "7.3"])


@versions
def test_reads_variables(tmp_path: Path, version: str) -> None:
    assert is_the_log(pt.read(save(tmp_path / "log.mat", PLAIN, version)))


@versions
def test_reads_rows_and_columns(tmp_path: Path, version: str) -> None:
    variables = {"time_s": T[None, :], "voltage_V": U[:, None], "displacement_um": Y[None, :]}
    assert is_the_log(pt.read(save(tmp_path / "log.mat", variables, version)))


@versions
def test_reads_a_structure_with_units_beside_it(tmp_path: Path, version: str) -> None:
    path = save(tmp_path / "log.mat", STRUCTURE, version)
    assert is_the_log(pt.read(path))
    assert is_the_log(pt.read(path, drive="log/drive", displacement="displacement"))


@versions
def test_a_rate_in_the_file_is_used(tmp_path: Path, version: str) -> None:
    variables = {"voltage_V": U, "displacement_um": Y, "fs_Hz": 200.0}
    log = pt.read(save(tmp_path / "log.mat", variables, version))
    assert is_the_log(log)
    assert log.dt == pytest.approx(DT, rel=1e-15)


@versions
def test_a_name_in_two_structures_is_listed(tmp_path: Path, version: str) -> None:
    other = {"log": STRUCTURE["log"], "old": {**STRUCTURE["log"], "drive": U / 2.0}}
    path = save(tmp_path / "log.mat", other, version)
    found = refusal(path)
    assert "several columns could be the drive: 'log/drive' [V] (400 samples), 'old/dr" in found
    assert "'drive' is the name of several columns" in refusal(path, drive="drive")
    # The others are those of the same structure.
    assert is_the_log(pt.read(path, drive="log/drive"))


@versions
def test_texts_and_cells_are_left_out(tmp_path: Path, version: str) -> None:
    variables = {**PLAIN, "operator": "me", "notes": np.array(["a", "b"], dtype=object)}
    assert is_the_log(pt.read(save(tmp_path / "log.mat", variables, version)))
    path = save(tmp_path / "text.mat", {"operator": "me"}, version)
    assert "no column of numbers" in refusal(path)


def test_v73_says_which_extra_reads_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = save(tmp_path / "log.mat", PLAIN, "7.3")
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    assert refusal(path).endswith(
        "is read with h5py, which is not installed: expected pip install 'piezotrack[mat]'"
    )


def test_a_version_that_is_not_read_is_named(tmp_path: Path) -> None:
    scipy_io.savemat(tmp_path / "log.mat", PLAIN, format="4")
    assert "version 5, 7 or 7.3" in refusal(tmp_path / "log.mat")
    (tmp_path / "log.mat").write_bytes(b"")
    assert refusal(tmp_path / "log.mat") == "log.mat: is empty: expected a log"


LIES = {
    "an element beyond the file": mat_element(14, mat_array((1, 3), bytes(24)), 4_000_000_000),
    "values beyond the file": mat_element(14, mat_array((1, 3), bytes(24), count=4_000_000_000)),
    "dimensions beyond the values": mat_element(14, mat_array((100_000, 100_000), bytes(24))),
    "a compressed size": mat_element(
        15, zlib.compress(struct.pack("<II", 14, 4_000_000_000) + mat_array((1, 3), bytes(24)))
    ),
    "compressed dimensions": mat_element(
        15, zlib.compress(mat_element(14, mat_array((2_000_000_000, 1), bytes(24))))
    ),
    "a bomb": mat_element(
        15, zlib.compress(mat_element(14, mat_array((25_000_000, 1), bytes(200_000_000))), 9)
    ),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_file_that_lies_about_its_sizes_is_refused(tmp_path: Path, lie: str) -> None:
    path = tmp_path / "log.mat"
    path.write_bytes(MAT_HEADER + LIES[lie])
    found = refusal(path)
    assert "declares" in found
    assert "expected" in found


FLAGS, SHAPE, NAME = (
    mat_element(6, struct.pack("<II", 6, 0)),
    mat_element(5, struct.pack("<2i", 1, 3)),
    mat_element(1, b"voltage_V"),
)
STRUCTURED = mat_element(6, struct.pack("<II", 2, 0)) + mat_element(5, struct.pack("<2i", 1, 1))
UNSOUND = {
    "half a tag": bytes(4),
    "an element that is no variable": mat_element(9, bytes(24)),
    "compressed: no tag": mat_element(15, zlib.compress(b"abc")),
    "compressed: no variable": mat_element(15, zlib.compress(mat_element(9, bytes(24)))),
    "compressed: none of it": mat_element(15, b"not compressed at all"),
    "no flags": mat_element(14, mat_element(6, b"") + SHAPE + NAME),
    "nothing but flags": mat_element(14, FLAGS),
    "a shape below nothing": mat_element(14, mat_array((-1, 3), bytes(24))),
    "values of no type": mat_element(14, FLAGS + SHAPE + NAME + mat_element(99, bytes(24))),
    "more values than places": mat_element(14, mat_array((1, 3), bytes(32))),
    "five bytes in a tag for four": mat_element(14, FLAGS + struct.pack("<HHI", 5, 5, 0)),
    "fields without a length": mat_element(
        14, STRUCTURED + NAME + mat_element(5, b"") + mat_element(1, b"time")
    ),
    "fields of no letters": mat_element(
        14, STRUCTURED + NAME + mat_element(5, struct.pack("<i", 0)) + mat_element(1, b"time")
    ),
}


@pytest.mark.parametrize("fault", UNSOUND)
def test_a_file_that_is_not_sound_is_refused(tmp_path: Path, fault: str) -> None:
    """Behind a variable that is: nothing of a damaged file is taken for a log."""
    path = tmp_path / "log.mat"
    path.write_bytes(
        MAT_HEADER + mat_element(14, mat_array((1, 400), U.tobytes())) + UNSOUND[fault]
    )
    assert "is not a sound MAT file" in refusal(path, dt=DT)


@pytest.mark.parametrize("kind", [1, 2, 3, 4, 5])
def test_cells_and_structures_take_no_memory_however_many(tmp_path: Path, kind: int) -> None:
    path = tmp_path / "log.mat"
    path.write_bytes(MAT_HEADER + mat_element(14, mat_array((500_000, 1000), bytes(24), kind=kind)))
    assert "no column of numbers" in refusal(path)


def test_what_the_lies_are_made_of_is_true(tmp_path: Path) -> None:
    """The same elements with true sizes are a file that is read."""
    path = tmp_path / "log.mat"
    path.write_bytes(MAT_HEADER + mat_element(14, mat_array((1, 400), U.tobytes())))
    assert np.array_equal(scipy_io.loadmat(path)["voltage_V"].ravel(), U)
    assert "known to be the displacement" in refusal(path, dt=DT)


def test_the_other_order_of_bytes(tmp_path: Path) -> None:
    def part(kind: int, content: bytes) -> bytes:
        return struct.pack(">II", kind, len(content)) + content + bytes(-len(content) % 8)

    def variable(name: bytes, values: np.ndarray) -> bytes:
        flags = part(6, struct.pack(">II", 6, 0))
        shape = part(5, struct.pack(">2i", 1, values.size))
        return part(14, flags + shape + part(1, name) + part(9, values.astype(">f8").tobytes()))

    named = ((b"time_s", T), (b"voltage_V", U), (b"displacement_um", Y))
    body = b"".join(variable(name, values) for name, values in named)
    path = tmp_path / "log.mat"
    path.write_bytes(MAT_HEADER[:124] + b"\x01\x00MI" + body)
    assert is_the_log(pt.read(path))
    assert np.array_equal(scipy_io.loadmat(path)["voltage_V"].ravel(), U)


def test_reads_what_scipy_reads(tmp_path: Path) -> None:
    """Numbers of every type, short ones in the tags, logical values and empty arrays."""
    types = ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8", "?"]
    variables = {f"v{code.replace('?', 'b')}": np.arange(5).astype(code) for code in types}
    variables |= {"empty": np.zeros((0, 3)), "z": np.arange(3) * 1j, "m": np.eye(4)[:, :3]}
    for compressed in (False, True):
        path = tmp_path / "log.mat"
        scipy_io.savemat(path, variables, do_compression=compressed)
        theirs = scipy_io.loadmat(path)
        ours = {one.name: one for one in read_variables(Source(path))}
        for name in variables:
            values = ours[name].values
            assert ours[name].shape == theirs[name].shape
            if name != "z":
                assert isinstance(values, np.ndarray)
                assert np.array_equal(values, theirs[name])


@versions
def test_damaged_files_are_refused_in_a_sentence(tmp_path: Path, version: str) -> None:
    assert survives(save(tmp_path / "log.mat", {**PLAIN, **STRUCTURE}, version)) > 20
