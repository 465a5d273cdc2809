"""TDMS, written by npTDMS."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from children import child
from format_logs import DT, TEMPERATURE, T, U, Y, is_the_log, refusal, survives
from log_writers import tdms, waveform
from piezotrack.data.checks.record_flags import record_warnings

if TYPE_CHECKING:
    from pathlib import Path

pytest.importorskip("nptdms")


def measured(path: Path) -> Path:
    return tdms(
        path,
        ("run", "Voltage", U, waveform("Volts")),
        ("run", "Position", Y, waveform("um")),
        ("slow", "Temperature", TEMPERATURE, waveform("K", 10 * DT)),
    )


def test_units_and_rate_are_those_of_the_channels(tmp_path: Path) -> None:
    log = pt.read(measured(tmp_path / "log.tdms"))
    assert is_the_log(log)
    assert log.dt == DT
    assert log.drive_unit == "V"


def test_single_precision_and_integers_are_read(tmp_path: Path) -> None:
    path = tdms(
        tmp_path / "log.tdms",
        ("run", "Voltage_mV", (1000 * U).astype(np.int32), {"wf_increment": DT}),
        ("run", "Position", Y.astype(np.float32), waveform("um")),
    )
    assert is_the_log(pt.read(path), tolerance=2e-3)


def test_without_a_unit_it_has_to_be_given(tmp_path: Path) -> None:
    path = tdms(
        tmp_path / "log.tdms",
        ("run", "Voltage", U, {"wf_increment": DT}),
        ("run", "Position", Y, {"wf_increment": DT}),
    )
    assert "column 'run/Voltage' has no unit" in refusal(path)
    assert is_the_log(pt.read(path, units={"Voltage": "V", "run/Position": "um"}))


def test_times_of_a_channel_are_used(tmp_path: Path) -> None:
    dates = np.datetime64("2024-03-12T23:59:59.5") + np.rint(1e6 * T).astype("timedelta64[us]")
    for time, unit in ((T, {"unit_string": "s"}), (dates, {"unit_string": "s"})):
        path = tdms(
            tmp_path / "log.tdms",
            ("run", "Time", time, unit),
            ("run", "Voltage", U, {"unit_string": "V"}),
            ("run", "Position", Y, {"unit_string": "um"}),
        )
        assert is_the_log(pt.read(path))


def test_times_that_contradict_the_increment_are_used_and_said(tmp_path: Path) -> None:
    """LabVIEW writes an increment of 1 s where none was set."""
    path = tdms(
        tmp_path / "log.tdms",
        ("run", "Time", T, waveform("s", 1.0)),
        ("run", "Voltage", U, waveform("V", 1.0)),
        ("run", "Position", Y, waveform("um", 1.0)),
    )
    log = pt.read(path)
    assert is_the_log(log)
    (note,) = log.notes
    assert note.startswith("the file states an interval of 1 s, and the times of column 'run/Time'")
    assert note in record_warnings(log)


def test_of_several_groups_one_is_named(tmp_path: Path) -> None:
    path = tdms(
        tmp_path / "log.tdms",
        *(
            (f"run {k}", name, values / k, waveform(unit))
            for k in (1, 2)
            for name, values, unit in (("Voltage", U, "V"), ("Position", Y, "um"))
        ),
    )
    assert "several columns could be the drive" in refusal(path)
    assert is_the_log(pt.read(path, drive="run 1/Voltage"))
    log = pt.read(path, drive="run 2/Voltage")
    assert np.array_equal(log.y, Y / 2 / 1e6)
    assert "name of several columns" in refusal(path, drive="Voltage")


def test_of_many_channels_those_with_a_like_name_come_first(tmp_path: Path) -> None:
    channels = [("run", f"channel {k}", U, waveform("V")) for k in range(50)]
    path = tdms(tmp_path / "log.tdms", *channels, ("run", "Amplifier", U, waveform("V")))
    found = refusal(path, drive="Amplifer")
    assert "the columns are 'run/Amplifier' [V] (400 samples), 'run/channel 0'" in found
    assert found.endswith("and 45 more")


def test_rates_that_differ_are_named(tmp_path: Path) -> None:
    path = tdms(
        tmp_path / "log.tdms",
        ("run", "Voltage", U, waveform("V")),
        ("run", "Position", Y, waveform("um", 2 * DT)),
    )
    found = refusal(path)
    assert "0.005 s for column 'run/Voltage' and 0.01 s for column 'run/Position'" in found
    assert is_the_log(pt.read(path, dt=DT))


def test_a_count_of_samples_that_is_not_true_is_refused(tmp_path: Path) -> None:
    path = measured(tmp_path / "log.tdms")
    content = path.read_bytes()
    # The raw data index of a channel: type double, one dimension, number of values.
    index = struct.pack("<IIQ", 10, 1, 400)
    assert content.count(index) == 2
    for count in (4_000_000_000_000, 401, 2**63):
        path.write_bytes(content.replace(index, struct.pack("<IIQ", 10, 1, count), 1))
        found = refusal(path)
        assert str(count) in found or count == 2**63


def test_an_offset_beyond_the_file_is_refused(tmp_path: Path) -> None:
    path = measured(tmp_path / "log.tdms")
    content = bytearray(path.read_bytes())
    # Lead-in: tag, mask, version, then offsets of the next segment and of the samples.
    for place, value in ((12, 10**15), (20, 10**15), (12, 2**64 - 1)):
        changed = bytearray(content)
        struct.pack_into("<Q", changed, place, value)
        path.write_bytes(changed)
        refusal(path)


def test_a_file_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    path = measured(tmp_path / "log.tdms")
    path.write_bytes(path.read_bytes()[:-100])
    assert "is cut off in its last segment" in refusal(path)


def test_damaged_files_are_refused_in_a_sentence(tmp_path: Path) -> None:
    assert survives(measured(tmp_path / "log.tdms")) > 20


def widths(count: int) -> bytes:
    """A segment of DAQmx that says for how many cards samples are interleaved in it."""
    index = struct.pack("<IIIQII", 0x1269, 0xFFFFFFFF, 1, 100, 0, count)
    metadata = struct.pack("<II", 1, 8) + b"/'a'/'b'" + index + bytes(4)
    # The table of contents: metadata, new objects, raw data, of DAQmx.
    return b"TDSm" + struct.pack("<IIQQ", 0x8E, 4713, len(metadata), len(metadata)) + metadata


@pytest.mark.parametrize("part", ["name", "value", "widths"])
def test_metadata_do_not_ask_for_more_than_the_file_has(tmp_path: Path, part: str) -> None:
    path = measured(tmp_path / "log.tdms")
    content = path.read_bytes()
    # Texts with their lengths before them: the name of a property, and its value.
    texts = {"name": b"unit_string", "value": b"Volts"}
    if part in texts:
        text = struct.pack("<I", len(texts[part])) + texts[part]
        assert text in content
        path.write_bytes(content.replace(text, struct.pack("<I", 2**32 - 16) + texts[part]))
    else:
        path.write_bytes(widths(2**32 - 16))
    code = f"try: pt.read({str(path)!r})\nexcept pt.DataError as error: print(error)"
    done = child("import nptdms\n" + code, room=1_000_000_000)
    assert done.stdout.startswith("log.tdms: is not a sound TDMS file"), done.stderr[-500:]
