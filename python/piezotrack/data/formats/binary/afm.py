"""Curves of atomic force microscopes, with afmformats: JPK, Asylum and others."""

from __future__ import annotations

import importlib
import zipfile
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..table import Channel, ChannelTable, Format

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..source import Source

__all__ = ["FORMAT"]

ENDINGS = (".jpk-force", ".jpk-force-map", ".jpk-qi-data", ".jpk-qi-series", ".ibw")


def _opens(source: Source) -> ChannelTable:
    library = source.library("afmformats", "afm")
    with _opened(source):
        if zipfile.is_zipfile(source.path):
            with zipfile.ZipFile(source.path) as archive:
                for info in archive.infolist():
                    source.check_size(f"member {info.filename!r}", info.file_size)
                total = sum(info.file_size for info in archive.infolist())
                source.check_size("the sum of the members", total)
        curves, uncalibrated = _curves(source, library)
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
            if name not in uncalibrated
        ]
    return ChannelTable(source, channels)


def _curves(source: Source, library: Any) -> tuple[Any, tuple[str, ...]]:
    """Load the curves, and say which columns are not calibrated: heights need no spring."""
    try:
        return library.load_data(source.path), ()
    except library.errors.MissingMetaDataError as error:
        anything = dict.fromkeys(error.meta_keys, 1.0)
        return library.load_data(source.path, meta_override=anything), ("force", "tip position")


def _read(source: Source, curve: Any, name: str) -> Any:
    with _opened(source):
        return np.asarray(curve[name])


@contextmanager
def _opened(source: Source) -> Iterator[None]:
    """Close the archive behind reading, also where it fails: afmformats keeps it by its name."""
    reader = importlib.import_module("afmformats.formats.fmt_jpk.jpk_reader")
    try:
        with source.decoding("AFM", "afmformats"):
            yield
    finally:
        archive = reader.ArchiveCache.open_archives.pop(source.path, None)
        if archive is not None:
            archive.close()


FORMAT = Format(
    name="AFM",
    endings=ENDINGS,
    opens=_opens,
    begins=lambda head: head.startswith(b"# afmformats"),
)
