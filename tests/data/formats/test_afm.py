"""Curves of atomic force microscopes, written by afmformats."""

from __future__ import annotations

import zipfile
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from format_logs import DT, T, U, Y, refusal
from log_writers import afm

if TYPE_CHECKING:
    from pathlib import Path

pytest.importorskip("afmformats", reason="afmformats, of the extra afm, is not installed")


def write(path: Path, fmt: str) -> Path:
    columns = {
        "force": 1e-9 * U,
        "height (measured)": 1e-6 * Y,
        "height (piezo)": 1e-6 * U,
        "time": T,
        "segment": (T > 1.0).astype(np.uint8),
    }
    return afm(path, columns, fmt)


@pytest.mark.parametrize("fmt", ["tab", "h5"])
def test_the_height_of_the_piezo_is_the_drive(tmp_path: Path, fmt: str) -> None:
    log = pt.read(write(tmp_path / f"curve.{fmt}", fmt))
    assert log.drive_unit == "m"
    assert np.abs(log.u - 1e-6 * U).max() < 1e-12
    assert np.abs(log.y - 1e-6 * Y).max() < 1e-12
    assert log.column_units["force"] == "N"


def jpk(path: Path, *, calibrated: bool = True, curves: int = 1) -> Path:
    """An archive as JPK's software makes it: properties, and big-endian integers with a scale.

    Of several curves each is in a folder of its own, the next one a micrometre higher.
    """
    with zipfile.ZipFile(path, "w") as archive:
        if curves == 1:
            _curve(archive, "", 0.0, calibrated=calibrated)
            return path
        archive.writestr("header.properties", "type=force-scan-map\n")
        archive.writestr("index/", "")
        for k in range(curves):
            archive.writestr(f"index/{k}/", "")
            _curve(archive, f"index/{k}/", 1e-6 * k, calibrated=calibrated)
    return path


def _curve(archive: zipfile.ZipFile, inside: str, height: float, *, calibrated: bool) -> None:
    half = T.size // 2
    heights = 1e-6 * Y + height
    signals = {"height": (1e-6 * U, "calibrated"), "capacitiveSensorHeight": (heights, "nominal")}
    archive.writestr(f"{inside}header.properties", "type=force-scan\n")
    archive.writestr(f"{inside}segments/", "")
    for number, style in enumerate(("extend", "retract")):
        part = slice(number * half, (number + 1) * half)
        folder = f"{inside}segments/{number}/"
        settings = "force-segment-header.settings"
        lines = [
            f"{settings}.style={style}",
            f"{settings}.segment-settings.duration={DT * half}",
            f"{settings}.segment-settings.z-start=0.0",
            f"{settings}.segment-settings.z-end=4.0E-5",
            f"force-segment-header.duration={DT * half}",
            f"force-segment-header.num-points={half}",
            "force-segment-header.approach-id=0",
            "force-segment-header.time-stamp=2024-03-12 10:00:00.000 +0100",
            "force-scan-series.header.position-index=0",
        ]
        if calibrated:
            conversion = "channel.vDeflection.conversion-set.conversion"
            lines += [
                f"{conversion}.distance.scaling.multiplier=7.0E-8",
                f"{conversion}.force.scaling.multiplier=0.04",
            ]
        archive.writestr(folder, "")
        for name, (values, slot) in signals.items():
            channel = f"channel.{name}"
            lines += [
                f"{channel}.data.encoder.type=signedinteger",
                f"{channel}.data.encoder.scaling.multiplier=1.0E-12",
                f"{channel}.data.encoder.scaling.offset=0.0",
                f"{channel}.conversion-set.conversions.base=volts",
                f"{channel}.conversion-set.conversion.{slot}.scaling.multiplier=1.0",
                f"{channel}.conversion-set.conversion.{slot}.scaling.offset=0.0",
                f"{channel}.conversion-set.conversion.{slot}.base-calibration-slot=volts",
                f"{channel}.conversion-set.conversion.{slot}.scaling.unit.unit=m",
                f"{channel}.conversion-set.conversion.{slot}.name={slot}",
            ]
            content = np.rint(values[part] / 1e-12).astype(">i4").tobytes()
            archive.writestr(f"{folder}channels/{name}.dat", content)
        archive.writestr(f"{folder}segment-header.properties", "\n".join(lines))


@pytest.mark.parametrize("calibrated", [True, False])
def test_an_archive_of_jpk(tmp_path: Path, calibrated: bool) -> None:
    """Heights are read, whether the spring is known or not."""
    path = jpk(tmp_path / "curve.jpk-force", calibrated=calibrated)
    log = pt.read(path)
    assert log.drive_unit == "m"
    assert np.abs(log.u - 1e-6 * U).max() < 1e-11
    assert np.abs(log.y - 1e-6 * Y).max() < 1e-11
    assert log.dt == pytest.approx(DT)
    # The deflection is not in this archive.
    assert "force" not in log.columns
    said = [note for note in log.notes if note.startswith("column 'force' is left out")]
    assert len(said) == calibrated


def test_a_curve_of_several_is_chosen_by_its_group(tmp_path: Path) -> None:
    path = jpk(tmp_path / "map.jpk-force-map", curves=3)
    assert "'curve 0/height (piezo)'" in refusal(path)
    for k in range(3):
        log = pt.read(path, drive=f"curve {k}/height (piezo)")
        assert log.drive_unit == "m"
        assert np.abs(log.u - 1e-6 * U).max() < 1e-11
        assert np.abs(log.y - (1e-6 * Y + 1e-6 * k)).max() < 1e-11


def test_an_archive_that_expands_beyond_measure_is_refused(tmp_path: Path) -> None:
    path = jpk(tmp_path / "curve.jpk-force")
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("segments/0/channels/vDeflection.dat", bytes(110_000_000))
    assert "declares 110000000 bytes" in refusal(path)


def test_a_file_that_was_refused_is_read_when_it_is_whole(tmp_path: Path) -> None:
    """As one that was read while it was still being copied; nothing of it stays open."""
    from afmformats.formats.fmt_jpk.jpk_reader import ArchiveCache

    whole = jpk(tmp_path / "whole.jpk-force")
    path = tmp_path / "curve.jpk-force"
    with zipfile.ZipFile(whole) as archive, zipfile.ZipFile(path, "w") as part:
        for name in archive.namelist()[:3]:
            part.writestr(name, archive.read(name))
    refusal(path)
    assert list(ArchiveCache.open_archives) == []
    path.unlink()
    whole.rename(path)
    assert pt.read(path).u.size == T.size
    assert list(ArchiveCache.open_archives) == []


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    for ending in (".jpk-force", ".ibw"):
        path = tmp_path / f"curve{ending}"
        path.write_bytes(b"PK\x03\x04" + bytes(300))
        assert "is not a sound AFM file" in refusal(path)
