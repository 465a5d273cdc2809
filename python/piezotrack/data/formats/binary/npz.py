"""NumPy's files: NPZ with one array for each column, and NPY."""

from __future__ import annotations

import math
import zipfile
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..table import Channel, ChannelTable, Format, split_matrix

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from ..source import Source
    from ..table import WrittenColumn

__all__ = ["FORMAT", "NPY"]

# Letters of the header of an array, at most.
MOST_HEADER = 10_000


def _opens(source: Source) -> ChannelTable:
    with source.decoding("NPZ"):
        channels: list[Channel] = []
        with zipfile.ZipFile(source.path) as archive:
            for info in archive.infolist():
                if info.filename.endswith(".npy"):
                    with archive.open(info) as member:
                        shape, dtype = _header(member)
                        begins = member.tell()
                    name = info.filename.removesuffix(".npy")
                    stored = info.file_size - begins
                    _check(source, f"array {name!r}", shape, dtype, stored)
                    source.check_size(f"array {name!r}", stored)
                    channels += _channels(name, shape, dtype, _reader(source, info.filename))
    return ChannelTable(source, channels)


def _opens_npy(source: Source) -> ChannelTable:
    with source.decoding("NPY"):
        with source.path.open("rb") as file:
            shape, dtype = _header(file)
            begins = file.tell()
        _check(source, "the array", shape, dtype, source.size - begins)

        @cache
        def read() -> Any:
            with source.decoding("NPY"):
                return np.load(source.path, allow_pickle=False)

        channels = _channels("", shape, dtype, read)
        return ChannelTable(source, channels, titled=dtype.names is not None)


def _header(file: Any) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Read shape and type of an array; NumPy refuses a header longer than `MOST_HEADER`."""
    version = np.lib.format.read_magic(file)
    reads = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }
    if version not in reads:
        raise ValueError(f"version {version} of the array format")
    shape, _, dtype = reads[version](file, max_header_size=MOST_HEADER)
    return shape, dtype


def _check(
    source: Source, what: str, shape: Sequence[int], dtype: np.dtype[Any], stored: int
) -> None:
    """Refuse an array whose bytes are not all there."""
    if min(shape, default=0) < 0:
        raise source.error(f"{what} has the shape {shape}: expected lengths of 0 or more")
    declared = math.prod(shape) * dtype.itemsize
    if not dtype.hasobject:
        source.check_size(what, declared, stored=stored)


def _channels(
    name: str, shape: tuple[int, ...], dtype: np.dtype[Any], read: Callable[[], Any]
) -> Iterator[Channel]:
    """Divide an array into channels; texts and objects are none."""
    if dtype.names is not None:
        for part in dtype.names:
            inner = dtype[part]
            if inner.shape == () and len(shape) == 1 and inner.kind in "biufMm":
                yield Channel(part, shape[0], partial(_part, read, part), group=name)
    elif dtype.kind in "biufMm":
        # A unit in brackets ends a title, whose slash is not that of a group.
        group, _, last = ("", "", name) if name.endswith("]") else name.rpartition("/")
        for column, place, count in split_matrix(last, shape):
            yield Channel(column, count, partial(_part, read, place), group=group)


def _part(read: Callable[[], Any], place: Any) -> Any:
    return read()[place]


def _reader(source: Source, member: str) -> Callable[[], Any]:
    def read() -> Any:
        with (
            source.decoding("NPZ"),
            zipfile.ZipFile(source.path) as archive,
            archive.open(member) as file,
        ):
            return np.lib.format.read_array(file, allow_pickle=False)

    # Once for all columns of a matrix.
    return partial(source.latest, member, read)


def _begins(head: bytes) -> bool:
    return head.startswith(b"PK\x03\x04") and b".npy" in head[30:300]


def _writes(path: Path, columns: Sequence[WrittenColumn]) -> None:
    """Write one array for each column, its title with the unit as its name."""
    with path.open("wb") as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for column in columns:
            # With a date of its own, the same log gives the same file.
            info = zipfile.ZipInfo(f"{column.title}.npy", (1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            with archive.open(info, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, column.values, allow_pickle=False)


FORMAT = Format(name="NPZ", endings=(".npz",), opens=_opens, begins=_begins, writes=_writes)
NPY = Format(
    name="NPY",
    endings=(".npy",),
    opens=_opens_npy,
    begins=lambda head: head.startswith(b"\x93NUMPY"),
)
