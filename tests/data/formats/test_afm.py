"""Curves of atomic force microscopes, written by afmformats."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from format_logs import T, U, Y, refusal

if TYPE_CHECKING:
    from pathlib import Path

afmformats: Any = pytest.importorskip(
    "afmformats", reason="afmformats, of the extra afm, is not installed"
)


def write(path: Path, fmt: str) -> Path:
    curve = afmformats.AFMForceDistance(
        data={
            "force": 1e-9 * U,
            "height (measured)": 1e-6 * Y,
            "height (piezo)": 1e-6 * U,
            "time": T,
            "segment": (T > 1.0).astype(np.uint8),
        },
        metadata={
            "spring constant": 0.05,
            "imaging mode": "force-distance",
            "path": str(path),
            "enum": 0,
            "software": "none",
            "software version": "1",
        },
    )
    curve.export_data(path, fmt=fmt)
    return path


@pytest.mark.parametrize("fmt", ["tab", "h5"])
def test_the_height_of_the_piezo_is_the_drive(tmp_path: Path, fmt: str) -> None:
    log = pt.read(write(tmp_path / f"curve.{fmt}", fmt))
    assert log.drive_unit == "m"
    assert np.abs(log.u - 1e-6 * U).max() < 1e-12
    assert np.abs(log.y - 1e-6 * Y).max() < 1e-12
    assert log.column_units["force"] == "N"


def test_a_file_that_is_none_is_refused(tmp_path: Path) -> None:
    for ending in (".jpk-force", ".ibw"):
        path = tmp_path / f"curve{ending}"
        path.write_bytes(b"PK\x03\x04" + bytes(300))
        assert "is not a sound AFM file" in refusal(path)
