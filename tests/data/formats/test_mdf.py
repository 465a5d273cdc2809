"""MDF4 and MDF3, written by asammdf."""

from __future__ import annotations

import re
import struct
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from format_logs import DT, TEMPERATURE, T, U, Y, is_the_log, refusal, survives

if TYPE_CHECKING:
    from pathlib import Path

asammdf: Any = pytest.importorskip("asammdf", reason="asammdf, of the extra mdf, is not installed")


def write(path: Path, version: str = "4.10", compression: int = 0) -> Path:
    signal = asammdf.Signal
    with asammdf.MDF(version=version) as file:
        file.append(
            [signal(U, T, name="Voltage", unit="V"), signal(Y, T, name="Position", unit="um")],
            acq_name="fast",
            comment="a run",
        )
        slow = signal(TEMPERATURE, 10 * DT * np.arange(40), name="Temperature", unit="K")
        file.append([slow], acq_name="slow", comment="the room")
        file.save(path, overwrite=True, compression=compression)
    return path


@pytest.mark.parametrize(("version", "ending"), [("4.10", ".mf4"), ("3.30", ".mdf")])
def test_channels_units_and_times(tmp_path: Path, version: str, ending: str) -> None:
    log = pt.read(write(tmp_path / f"log{ending}", version))
    assert is_the_log(log)
    assert log.notes == ()


def test_compressed_blocks(tmp_path: Path) -> None:
    assert is_the_log(pt.read(write(tmp_path / "log.mf4", compression=2)))


def test_the_time_is_that_of_the_group(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mf4")
    found = refusal(path, displacement="Temperature", units={"Temperature": "um"})
    assert "expected equally many" in found
    assert "'fast/Voltage' [V] (400 samples)" in refusal(path, drive="amplifier")


def test_more_cycles_than_the_file_has_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mf4")
    content = path.read_bytes()
    # A channel group: its cycles are 400, in records of 24 bytes.
    place = content.index(b"##CG") + 24 + 6 * 8 + 8
    assert struct.unpack_from("<Q", content, place) == (400,)
    for count in (10**12, 2**63):
        changed = bytearray(content)
        struct.pack_into("<Q", changed, place, count)
        path.write_bytes(changed)
        refusal(path)


def test_a_channel_beyond_its_record_is_refused(tmp_path: Path) -> None:
    """asammdf would read beyond its memory there, and end the process."""
    path = write(tmp_path / "log.mf4")
    content = path.read_bytes()
    # A channel: its kind, data type and bit offset, then the place of its first byte and its bits.
    for found in re.finditer(b"##CN", content):
        place = found.start() + 24 + 8 * 8 + 4
        assert struct.unpack_from("<I", content, place + 4) == (64,)
        for offset, value in ((0, 1000), (0, 2**32 - 1), (4, 2**31)):
            changed = bytearray(content)
            struct.pack_into("<I", changed, place + offset, value)
            path.write_bytes(changed)
            refusal(path)


def test_an_unfinished_file_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "log.mf4")
    content = path.read_bytes()
    # By its name, or by its flags for what is left to do.
    for unfinished in (b"UnFinMF " + content[8:], content[:60] + b"\x01" + content[61:]):
        path.write_bytes(unfinished)
        assert "was not finished by the program that wrote it" in refusal(path)


def test_damaged_files_are_refused_in_a_sentence(tmp_path: Path) -> None:
    assert survives(write(tmp_path / "log.mf4")) > 20
