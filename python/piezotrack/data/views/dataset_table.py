"""Table of a record, as a notebook shows it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..._support.display.table import words
from ..._support.units import best_length_unit

if TYPE_CHECKING:
    from ..dataset import Dataset

__all__ = ["dataset_html"]


def dataset_html(data: Dataset) -> str:
    """Write a record as a table in HTML."""
    unit, scale = best_length_unit(data.stroke)
    low, high = scale * data.y.min(), scale * data.y.max()
    rows = [
        ("samples", f"{len(data)}, {data.duration:.6g} s at {1.0 / data.dt:.6g} Hz"),
        ("time", f"{data.t[0]:.6g} to {data.t[-1]:.6g} s"),
        ("drive", f"{data.u.min():.4g} to {data.u.max():.4g} {data.drive_unit}, {data.hold}"),
        ("displacement", f"{low:.4g} to {high:.4g} {unit}"),
        ("stroke", f"{scale * data.stroke:.4g} {unit}"),
        ("warm-up", f"{data.warmup} samples"),
    ]
    if data.zero:
        rows.append(("zero", f"{scale * data.zero:.4g} {unit} subtracted"))
    rows += [(name, data.column_units.get(name, "")) for name in data.columns]
    rows += [("note", note) for note in data.notes]
    return words(f"Dataset {data.source or ''}".rstrip(), rows).html()
