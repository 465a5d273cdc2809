"""The heaps of texts in an HDF5 file, checked before the library reads them.

The format: HDF5 File Format Specification, III.E, global heap. A heap is a chain of objects, each
with its size; libhdf5 follows one whose sizes are damaged without end.
"""

from __future__ import annotations

import mmap
import struct
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .source import Source

__all__ = ["check_heaps"]

SIGNATURE = b"GCOL\x01\0\0\0"
# Bytes before the first object, and of the head of each object.
HEADER = 16


def check_heaps(source: Source) -> None:
    """Refuse a file in which a heap is not a chain of objects.

    Parameters
    ----------
    source : Source
        An HDF5 file.

    Raises
    ------
    DataError
        An object is beyond its heap, or a heap beyond the file.
    """
    if source.size == 0:
        return
    with (
        source.path.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content,
    ):
        place = content.find(SIGNATURE)
        while place >= 0:
            _check_heap(source, content, place)
            place = content.find(SIGNATURE, place + 1)


def _check_heap(source: Source, content: mmap.mmap, first: int) -> None:
    if first + HEADER > len(content):
        raise source.error("is not a sound HDF5 file, or is cut off: it ends within a heap")
    (size,) = struct.unpack_from("<Q", content, first + 8)
    source.check_size(f"the heap at byte {first}", size, stored=len(content) - first)
    place, end = first + HEADER, first + size
    while place + HEADER <= end:
        number, count = struct.unpack_from("<H6xQ", content, place)
        # The object 0 is what is free, its head included; the others are filled up to 8 bytes.
        step = count if number == 0 else HEADER + count + -count % 8
        if step < HEADER or place + step > end:
            raise source.error(
                f"is not a sound HDF5 file: in the heap at byte {first} an object at byte {place} "
                f"is said to have {count} bytes, expected {end - place - HEADER} at most"
            )
        place += step
