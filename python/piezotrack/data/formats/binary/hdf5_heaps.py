"""The texts in an HDF5 file and their heaps, checked before the library reads them.

The format: HDF5 File Format Specification, III.E, global heap, and IV.A.2.m, attribute message. A
heap is a chain of objects, each with its size; libhdf5 follows one whose sizes are damaged without
end. A text of variable length is its length and the place of an object in a heap; libhdf5 asks for
memory of that length, whatever it is, and older ones copy the object into it, whatever its size.
"""

from __future__ import annotations

import mmap
import struct
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..source import Source

__all__ = ["check_heaps"]

SUPERBLOCK = b"\x89HDF\r\n\x1a\n"
SIGNATURE = b"GCOL\x01"
# Bytes before the first object, and of the head of each object.
HEADER = 16


def check_heaps(source: Source, texts: Sequence[str]) -> None:
    """Refuse a file in which a heap is not a chain of objects, or a text is not in one.

    Parameters
    ----------
    source : Source
        An HDF5 file.
    texts : sequence of str
        Names of the attributes that may be read as texts.

    Raises
    ------
    DataError
        An object is beyond its heap, or a heap beyond the file, or a text has another length than
        its object.
    """
    if source.size == 0:
        return
    with (
        source.path.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content,
    ):
        heaps = {}
        place = content.find(SIGNATURE)
        while place >= 0:
            heaps[place] = _check_heap(source, content, place)
            place = content.find(SIGNATURE, place + 1)
        # Places are counted from the superblock, which may be behind a block of the user's.
        base = max(content.find(SUPERBLOCK), 0)
        for name in texts:
            _check_texts(source, content, name, base, heaps)


def _check_texts(
    source: Source, content: mmap.mmap, name: str, base: int, heaps: dict[int, dict[int, int]]
) -> None:
    """Check all attributes of a name whose values may be texts of variable length."""
    letters = name.encode() + b"\0"
    place = content.find(letters)
    while place >= 0:
        for version, size in ((1, 8), (2, 8), (3, 9)):
            if place < size:
                continue
            found, _, length, kind, space = struct.unpack_from("<BBHHH", content, place - size)
            if found != version or length != len(letters):
                continue
            # Each part is filled up to 8 bytes in the first version.
            parts = [part + (-part % 8 if version == 1 else 0) for part in (length, kind, space)]
            first, last = place + parts[0], place + sum(parts)
            # The class of the type is 9 for a variable length.
            if last + 16 <= len(content) and content[first] & 0x0F == 9:
                # Length, place and number of the object, of letters of one byte.
                sizes = struct.unpack_from("<I4xI", content, first + 4)
                if sizes != (struct.calcsize("<IQI"), 1):
                    raise source.error(
                        f"is not a sound HDF5 file: the attribute {name!r} at byte {place} is of a "
                        f"type of {sizes[0]} bytes, with letters of {sizes[1]}: expected 16 and 1"
                    )
                count, address, number = struct.unpack_from("<IQI", content, last)
                there = heaps.get(base + address, {}).get(number, min(count, source.size))
                if count != there:
                    raise source.error(
                        f"is not a sound HDF5 file: the attribute {name!r} at byte {place} is said "
                        f"to have {count} bytes, expected {there}"
                    )
        place = content.find(letters, place + 1)


def _check_heap(source: Source, content: mmap.mmap, first: int) -> dict[int, int]:
    """Return the sizes of the objects of a heap, by their numbers."""
    if first + HEADER > len(content):
        raise source.error("is not a sound HDF5 file, or is cut off: it ends within a heap")
    (size,) = struct.unpack_from("<Q", content, first + 8)
    source.check_size(f"the heap at byte {first}", size, stored=len(content) - first)
    place, end = first + HEADER, first + size
    sizes = {}
    while place + HEADER <= end:
        number, count = struct.unpack_from("<H6xQ", content, place)
        # The object 0 is what is free, its head included; the others are filled up to 8 bytes.
        step = count if number == 0 else HEADER + count + -count % 8
        if step < HEADER or place + step > end:
            raise source.error(
                f"is not a sound HDF5 file: in the heap at byte {first} an object at byte {place} "
                f"declares {count} bytes, expected {end - place - HEADER} at most"
            )
        sizes[number] = count
        place += step
    return sizes
