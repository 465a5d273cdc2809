"""HDF5, written by h5py."""

from __future__ import annotations

import re
import struct
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from children import child
from format_logs import DT, TEMPERATURE, T, U, Y, is_the_log, refusal, survives
from piezotrack.data.formats import apart

if TYPE_CHECKING:
    from pathlib import Path

h5py: Any = pytest.importorskip("h5py")


def with_units(path: Path, name: str = "units", **attributes: Any) -> Path:
    with h5py.File(path, "w") as file:
        run = file.create_group("scan 1/run")
        for dataset, values, unit in (
            ("time", T, "s"),
            ("voltage", U, "Volts"),
            ("position", Y, "\N{MICRO SIGN}m"),
        ):
            run[dataset] = values
            run[dataset].attrs[name] = unit
        file.create_dataset("slow/temperature", data=TEMPERATURE).attrs[name] = "K"
        for key, value in attributes.items():
            run.attrs[key] = value
    return path


@pytest.mark.parametrize("name", ["units", "unit", "Unit"])
def test_units_are_those_of_the_attributes(tmp_path: Path, name: str) -> None:
    log = pt.read(with_units(tmp_path / "log.h5", name))
    assert is_the_log(log)
    assert log.notes == ()


def test_another_unit_than_that_of_the_file_is_said(tmp_path: Path) -> None:
    path = with_units(tmp_path / "log.h5")
    log = pt.read(path, units={"displacement": "nm"})
    assert np.abs(log.y - 1e-9 * Y).max() < 1e-20
    (note,) = log.notes
    assert note == ("column 'scan 1/run/position': unit nm by units=, \N{MICRO SIGN}m in the file")
    # The same unit in other words is no contradiction.
    assert pt.read(path, units={"drive": "V", "displacement": "um"}).notes == ()


def test_a_title_and_an_attribute_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        file["time_s"], file["voltage_V"], file["x_um"] = T, U, Y
        file["x_um"].attrs["units"] = "nm"
    assert "'um in its title, nm beside it'" in refusal(path)
    assert is_the_log(pt.read(path, units={"displacement": "um"}))


def test_units_in_titles_do_too(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["time_s"], file["voltage_V"], file["displacement_um"] = T, U, Y
    assert is_the_log(pt.read(tmp_path / "log.h5"))
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["time"], file["voltage"], file["displacement"] = T, U, Y
    assert "has no unit" in refusal(tmp_path / "log.h5")


def test_a_rate_among_the_attributes_is_used(tmp_path: Path) -> None:
    path = tmp_path / "log.h5"
    for name, value in (("sample_rate_Hz", 200.0), ("dt_s", DT), ("dt", DT)):
        with h5py.File(path, "w") as file:
            file["voltage_V"], file["displacement_um"] = U, Y
            file.attrs[name] = value
        if name == "dt":
            assert "give the sampling interval with dt=" in refusal(path)
        else:
            assert is_the_log(pt.read(path))


def test_a_compound_dataset_has_named_columns(tmp_path: Path) -> None:
    rows = np.zeros(T.size, dtype=[("time_s", "f8"), ("voltage_V", "f8"), ("x_um", "f8")])
    rows["time_s"], rows["voltage_V"], rows["x_um"] = T, U, Y
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["table"] = rows
    assert is_the_log(pt.read(tmp_path / "log.h5", drive="table/voltage"))


def test_the_columns_of_another_length_are_named_with_it(tmp_path: Path) -> None:
    path = with_units(tmp_path / "log.h5")
    message = refusal(path, drive="amplifier")
    assert "'scan 1/run/voltage' [V] (400 samples)" in message
    assert "'slow/temperature' [K] (40 samples)" in message
    message = refusal(path, displacement="temperature", units={"displacement": "um"})
    assert "'slow/temperature' has 40 samples and column 'scan 1/run/voltage' has 400" in message


def test_the_extra_is_named_where_h5py_is_not_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = with_units(tmp_path / "log.h5")
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert refusal(path) == (
        "log.h5: is read with h5py, which is not installed: expected pip install 'piezotrack[hdf5]'"
    )


def test_a_dataset_whose_samples_are_not_there_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.h5"
    for options in ({}, {"chunks": (1000,)}, {"chunks": (1000,), "compression": "gzip"}):
        with h5py.File(path, "w") as file:
            file.create_dataset("voltage_V", shape=(10**12,), dtype="f8", **options)
            file["displacement_um"], file["time_s"] = Y, T
        assert "dataset '/voltage_V' declares 8000000000000 bytes" in refusal(path)


def test_a_dataset_in_which_one_chunk_of_many_is_there_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        lying = file.create_dataset("voltage_V", shape=(10**11,), dtype="f8", chunks=(1000,))
        lying[:400] = U
    assert "declares 800000000000 bytes" in refusal(path)


def test_a_heap_of_texts_that_leads_in_a_circle_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """libhdf5 goes round in such a one without end."""
    path = with_units(tmp_path / "log.h5")
    content = path.read_bytes()
    heap = content.index(b"GCOL")
    changed = bytearray(content)
    # The number of its first object, 0 for what is free, and its size.
    changed[heap + 16 : heap + 32] = bytes(16)
    path.write_bytes(changed)
    monkeypatch.setattr(apart, "PATIENCE", 1.0)
    assert "is not read within 1 s" in refusal(path)
    path.write_bytes(content)
    assert is_the_log(pt.read(path))


def test_samples_in_other_files_are_not_followed(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["voltage_V"] = U
    path = tmp_path / "log.h5"
    (tmp_path / "raw").write_bytes(U.tobytes())
    with h5py.File(path, "w") as file:
        file["linked"] = h5py.ExternalLink("other.h5", "/voltage_V")
        file.create_dataset(
            "outside", (400,), "f8", external=[(str(tmp_path / "raw"), 0, h5py.h5f.UNLIMITED)]
        )
        layout = h5py.VirtualLayout((400,), "f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "voltage_V", (400,))
        file.create_virtual_dataset("virtual", layout)
    assert "no column of numbers" in refusal(path)


def test_a_group_that_contains_itself_is_read_once(tmp_path: Path) -> None:
    path = with_units(tmp_path / "log.h5")
    with h5py.File(path, "a") as file:
        file["scan 1/run/again"] = file["scan 1"]
    assert is_the_log(pt.read(path))


def test_the_first_bytes_count_more_than_the_ending(tmp_path: Path) -> None:
    path = with_units(tmp_path / "log.h5").rename(tmp_path / "log.dat")
    assert is_the_log(pt.read(path))
    (tmp_path / "no.h5").write_text("time_s,voltage_V,displacement_um\n", encoding="utf-8")
    assert "is not a sound HDF5 file" in refusal(tmp_path / "no.h5")


@pytest.mark.parametrize("seed", [1, 2])
def test_damaged_files_are_refused_in_a_sentence(tmp_path: Path, seed: int) -> None:
    assert survives(with_units(tmp_path / "log.h5"), seed) > 20


def with_texts(path: Path) -> Path:
    """A log with texts of variable length wherever HDF5 may have them."""
    text = h5py.string_dtype()
    rows = np.zeros(
        T.size, dtype=[("time_s", "f8"), ("voltage_V", "f8"), ("x_um", "f8"), ("note", text)]
    )
    rows["time_s"], rows["voltage_V"], rows["x_um"], rows["note"] = T, U, Y, "none"
    with h5py.File(path, "w") as file:
        file["table"] = rows
        file["table"].attrs["units"] = "one for each column"
        file["table"].attrs["author"] = "me"
        file["names"] = np.array(["a", "b"], dtype=text)
        file.attrs["software"] = "any"
        file.attrs.create("keys", ["a", "b"], dtype=text)
        file.attrs["nothing"] = h5py.Empty("f8")
        file.attrs["dt_s"] = h5py.Empty("f8")
    return path


def test_texts_of_variable_length_beside_numbers_do_not_matter(tmp_path: Path) -> None:
    log = pt.read(with_texts(tmp_path / "log.h5"))
    assert is_the_log(log)
    assert log.notes == ()


def test_a_text_of_a_kind_that_does_not_exist_is_not_read(tmp_path: Path) -> None:
    """Reading it ends the process: libhdf5 calls a function that is not there."""
    content = with_texts(tmp_path / "log.h5").read_bytes()
    # The class 9 of types, variable length, and its kind, 1 for texts; padding and characters.
    places = [one.start() + 1 for one in re.finditer(rb"\x19[\x01\x11][\x00\x01]\x00\x10", content)]
    assert len(places) >= 6
    for number, place in enumerate(places):
        for kind in (0, 2, 250):
            changed = content[:place] + bytes([kind]) + content[place + 1 :]
            (tmp_path / f"log{number}_{kind}.h5").write_bytes(changed)
    code = f"""
import pathlib
import piezotrack.data.reader
read = refused = 0
for path in sorted(pathlib.Path({str(tmp_path)!r}).glob("log*_*.h5")):
    try:
        pt.read(path)
        read += 1
    except pt.PiezotrackError as error:
        assert str(error).startswith(path.name)
        refused += 1
print(read, refused)
"""
    done = child(code)
    assert done.returncode == 0, done.stderr[-500:]
    read, refused = map(int, done.stdout.split())
    assert read + refused == 3 * len(places)
    # What belongs to a text that is not needed does not matter.
    assert read > refused


def test_a_text_that_claims_gigabytes_is_refused(tmp_path: Path) -> None:
    """libhdf5 asks for the memory that its length says."""
    path = tmp_path / "log.h5"
    with h5py.File(path, "w", libver="earliest") as file:
        for name, values, unit in (("time", T, "s"), ("u", U, "Volts"), ("x", Y, "micrometre")):
            file[name] = values
            file[name].attrs["units"] = unit
    assert is_the_log(pt.read(path))
    content = bytearray(path.read_bytes())
    place = content.index(struct.pack("<IQ", 5, content.index(b"GCOL")))
    struct.pack_into("<I", content, place, 250 << 24)
    path.write_bytes(content)
    assert refusal(path).startswith("log.h5: ")
