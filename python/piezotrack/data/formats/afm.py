"""Curves of atomic force microscopes, with afmformats: JPK, Asylum and others."""

from __future__ import annotations

import zipfile
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from .table import Channel, ChannelTable, Format

if TYPE_CHECKING:
    from .source import Source

__all__ = ["FORMAT"]

ENDINGS = (".jpk-force", ".jpk-force-map", ".jpk-qi-data", ".jpk-qi-series", ".ibw")


def _opens(source: Source) -> ChannelTable:
    library = source.library("afmformats", "afm")
    with source.decoding("AFM"):
        if zipfile.is_zipfile(source.path):
            with zipfile.ZipFile(source.path) as archive:
                for info in archive.infolist():
                    source.check_size(f"member {info.filename!r}", info.file_size)
        curves = library.load_data(source.path)
        units = library.afm_data.column_units
        channels = [
            Channel(
                name=name,
                count=len(curve),
                read=partial(_read, source, curve, name),
                group=f"curve {number}" if len(curves) > 1 else "",
                # The library gives every column in SI.
                unit=units.get(name),
            )
            for number, curve in enumerate(curves)
            for name in curve.columns
        ]
    return ChannelTable(source, channels)


def _read(source: Source, curve: Any, name: str) -> Any:
    with source.decoding("AFM"):
        return np.asarray(curve[name])


FORMAT = Format(
    name="AFM",
    endings=ENDINGS,
    opens=_opens,
    begins=lambda head: head.startswith(b"# afmformats"),
)
