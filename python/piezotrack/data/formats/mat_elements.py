"""Sizes in a MAT file of version 5, checked before SciPy asks for memory.

The format: MathWorks, "MAT-File Format", chapter 1. Each element has a tag with its type and
its number of bytes; an array is an element of elements: flags, dimensions, name, values.
"""

from __future__ import annotations

import struct
import zlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .source import Source

__all__ = ["check_elements"]

HEADER = 128
COMPRESSED, MATRIX = 15, 14
CELL, STRUCT, OBJECT, SPARSE = 1, 2, 3, 5
# Bytes of a compressed variable from which only so many times the file's size are taken.
PIECE = 1 << 20
# Arrays within arrays.
DEEPEST = 64


def check_elements(source: Source) -> None:
    """Refuse a file in which an element has more bytes, or an array more values, than there are.

    Parameters
    ----------
    source : Source
        A MAT file of version 5.

    Raises
    ------
    DataError
        A size in the file is not true.
    """
    data = source.content()
    order = "<" if data[126:128] == b"IM" else ">"
    place = HEADER
    while place + 8 <= len(data):
        kind, count = struct.unpack_from(f"{order}II", data, place)
        source.check_size(f"the element at byte {place}", count, stored=len(data) - place - 8)
        body = memoryview(data)[place + 8 : place + 8 + count]
        if kind == COMPRESSED:
            content = _expanded(source, body, order)
            _array(source, memoryview(content)[8:], order, DEEPEST)
        elif kind == MATRIX:
            _array(source, body, order, DEEPEST)
        place += 8 + count + (-count % 8 if kind != COMPRESSED else 0)


def _expanded(source: Source, body: memoryview, order: str) -> bytes:
    """Decompress a variable whose tag says how long it is."""
    expander = zlib.decompressobj()
    tag = expander.decompress(body, 8)
    if len(tag) < 8:
        raise source.error("is not a sound MAT file: a compressed variable has no tag")
    kind, count = struct.unpack(f"{order}II", tag)
    if kind != MATRIX:
        raise source.error(f"is not a sound MAT file: a compressed variable is of type {kind}")
    source.check_size("a compressed variable", count)
    content = tag + expander.decompress(expander.unconsumed_tail, count + 8)
    source.check_size("a compressed variable", count, stored=len(content) - 8)
    return content


def _array(source: Source, body: memoryview, order: str, depth: int) -> None:
    """Check an array whose elements begin at the start of `body`."""
    if len(body) == 0:
        return
    if not depth:
        raise source.error(f"has more than {DEEPEST} arrays within each other")
    flags, place = _element(source, body, 0, order)
    if len(flags) < 8:
        raise source.error("is not a sound MAT file: an array has no flags")
    kind = struct.unpack_from(f"{order}I", flags)[0] & 0xFF
    if kind > SPARSE + 10:
        # Function handles and objects of MATLAB's own have no dimensions; SciPy skips them.
        return
    dimensions, place = _element(source, body, place, order)
    values = 1
    for (length,) in struct.iter_unpack(f"{order}i", dimensions[: len(dimensions) // 4 * 4]):
        values *= max(length, 0)
    least = 8 if kind in (CELL, STRUCT, OBJECT) else 1
    if kind != SPARSE and values:
        source.check_size(f"an array of {values} values", least * values, stored=len(body) - place)
    _, place = _element(source, body, place, order)
    if kind in (STRUCT, OBJECT):
        if kind == OBJECT:
            _, place = _element(source, body, place, order)
        _, place = _element(source, body, place, order)
        _, place = _element(source, body, place, order)
    while place + 8 <= len(body):
        inner, place = _element(source, body, place, order)
        if kind in (CELL, STRUCT, OBJECT):
            _array(source, inner, order, depth - 1)


def _element(source: Source, body: memoryview, place: int, order: str) -> tuple[memoryview, int]:
    """Return the bytes of an element and where the next one begins."""
    if place + 8 > len(body):
        raise source.error("is not a sound MAT file, or is cut off: an array ends within its parts")
    kind, count = struct.unpack_from(f"{order}II", body, place)
    if kind >> 16:
        # Up to four bytes are in the tag itself.
        count = kind >> 16
        return body[place + 4 : place + 4 + min(count, 4)], place + 8
    source.check_size("part of an array", count, stored=len(body) - place - 8)
    return body[place + 8 : place + 8 + count], place + 8 + count + (-count % 8)
