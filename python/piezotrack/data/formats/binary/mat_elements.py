"""The variables of a MAT file of version 5 or 7.

The format: MathWorks, "MAT-File Format", chapter 1. Each element has a tag with its type and
its number of bytes; an array is an element of elements: flags, dimensions, name, values. SciPy
reads these files too, but a damaged one can end the process, so every size is checked here.
"""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ..source import Source

__all__ = ["Variable", "read_variables"]

HEADER = 128
# Types of elements: those of numbers by their codes in NumPy, and the others.
NUMBERS = {
    **{1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4"},
    **{7: "f4", 9: "f8", 12: "i8", 13: "u8"},
}
MATRIX, COMPRESSED = 14, 15
TEXTS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}
# Classes of arrays.
CELL, STRUCT, CHAR, LOWEST, HIGHEST = 1, 2, 4, 6, 15
COMPLEX = 0x800
# Arrays within arrays, dimensions of one, and letters of a text that is kept.
DEEPEST, DIMENSIONS, LETTERS = 32, 32, 1000


@dataclass
class Variable:
    """A variable or a field.

    Attributes
    ----------
    name : str
        Its name; empty for a field.
    shape : tuple of int
        Its shape.
    values : ndarray, str, dict or None
        Numbers; a text; the fields of a structure of one element; None for anything else.
    """

    name: str
    shape: tuple[int, ...]
    values: np.ndarray | str | dict[str, Variable] | None


def read_variables(source: Source) -> list[Variable]:
    """Read the variables of a file.

    Parameters
    ----------
    source : Source
        A MAT file of version 5 or 7.

    Returns
    -------
    list of Variable
        In their order.

    Raises
    ------
    DataError
        A size in the file is not true, or it is damaged in another way.
    """
    data = memoryview(source.content())
    order = "<" if bytes(data[126:128]) == b"IM" else ">"
    variables, place, total = [], HEADER, 0
    while place < len(data):
        if place + 8 > len(data):
            _unsound(source, "it ends within a tag")
        kind, count = struct.unpack_from(f"{order}II", data, place)
        source.check_size(f"the element at byte {place}", count, stored=len(data) - place - 8)
        body = data[place + 8 : place + 8 + count]
        if kind == COMPRESSED:
            body = _expanded(source, body, order, total)
            total += len(body)
        elif kind == MATRIX:
            count += -count % 8
        else:
            _unsound(source, f"the element at byte {place} is of type {kind}")
        variables.append(_Array(source, order, DEEPEST).read(body))
        place += 8 + count
    return variables


def _unsound(source: Source, fault: str) -> NoReturn:
    raise source.error(f"is not a sound MAT file, or is cut off: {fault}")


def _expanded(source: Source, body: memoryview, order: str, before: int) -> memoryview:
    """Decompress a variable, whose tag says how long it is, behind `before` bytes of others."""
    expander = zlib.decompressobj()
    try:
        tag = expander.decompress(body, 8)
        if len(tag) < 8:
            _unsound(source, "a compressed variable has no tag")
        kind, count = struct.unpack(f"{order}II", tag)
        if kind != MATRIX:
            _unsound(source, f"a compressed variable is of type {kind}")
        source.check_size("a compressed variable", count)
        source.check_size("the sum of the compressed variables", before + count)
        content = expander.decompress(expander.unconsumed_tail, max(count, 1))
    except zlib.error as error:
        _unsound(source, f"{error}")
    source.check_size("a compressed variable", count, stored=len(content))
    return memoryview(content)


class _Array:
    """Reader of an array."""

    def __init__(self, source: Source, order: str, depth: int) -> None:
        self.source, self.order, self.depth = source, order, depth

    def read(self, body: memoryview) -> Variable:
        """Read an array whose elements are in `body`."""
        if len(body) == 0:
            return Variable("", (0, 0), None)
        parts = self._elements(body)
        flags, dimensions, name = (self._next(parts) for _ in range(3))
        if len(flags[1]) < 8:
            _unsound(self.source, "an array has no flags")
        (word,) = struct.unpack_from(f"{self.order}I", flags[1])
        kind = word & 0xFF
        if dimensions[0] != 5 or len(dimensions[1]) % 4 or len(dimensions[1]) > 4 * DIMENSIONS:
            # Objects of MATLAB's own have a name in this place.
            return Variable("", (0, 0), None)
        shape = struct.unpack(f"{self.order}{len(dimensions[1]) // 4}i", dimensions[1])
        if min(shape, default=0) < 0:
            _unsound(self.source, f"an array has the shape {shape[:4]}")
        title = bytes(name[1]).decode("latin-1")
        return Variable(title, shape, self._values(kind, bool(word & COMPLEX), shape, parts))

    def _values(
        self,
        kind: int,
        is_complex: bool,
        shape: tuple[int, ...],
        parts: Iterator[tuple[int, memoryview]],
    ) -> Any:
        if kind == STRUCT and math.prod(shape) == 1 and self.depth:
            return self._fields(parts)
        if kind == CHAR:
            return self._text(shape, *self._next(parts))
        if LOWEST <= kind <= HIGHEST:
            return self._numbers(shape, *self._next(parts), is_complex=is_complex)
        return None

    def _numbers(
        self, shape: tuple[int, ...], kind: int, content: memoryview, *, is_complex: bool
    ) -> np.ndarray | None:
        if kind not in NUMBERS:
            _unsound(self.source, f"the values of an array are of type {kind}")
        stored = np.frombuffer(content, dtype=np.dtype(self.order + NUMBERS[kind]))
        if stored.size != (count := math.prod(shape)):
            self.source.check_size(
                f"an array of {count} values",
                count * stored.itemsize,
                stored=stored.size * stored.itemsize,
            )
            _unsound(self.source, f"an array of the shape {shape[:4]} has {stored.size} values")
        return None if is_complex else stored.reshape(shape, order="F")

    def _text(self, shape: tuple[int, ...], kind: int, content: memoryview) -> str | None:
        if math.prod(shape) > LETTERS or len(content) > 4 * LETTERS or kind not in TEXTS:
            return None
        coding = TEXTS[kind]
        if coding in ("utf-16", "utf-32"):
            coding += "-le" if self.order == "<" else "-be"
        return bytes(content).decode(coding, "replace")

    def _fields(self, parts: Iterator[tuple[int, memoryview]]) -> dict[str, Variable]:
        (_, length), (_, letters) = self._next(parts), self._next(parts)
        if len(length) < 4:
            _unsound(self.source, "a structure has no length of its names")
        (size,) = struct.unpack_from(f"{self.order}i", length)
        if size <= 0 or len(letters) % size:
            _unsound(self.source, f"names of a structure are said to have {size} letters")
        fields = {}
        for first in range(0, len(letters), size):
            name = bytes(letters[first : first + size]).partition(b"\0")[0].decode("latin-1")
            _, content = self._next(parts)
            fields[name] = _Array(self.source, self.order, self.depth - 1).read(content)
        return fields

    def _next(self, parts: Iterator[tuple[int, memoryview]]) -> tuple[int, memoryview]:
        part = next(parts, None)
        if part is None:
            _unsound(self.source, "an array ends within its parts")
        return part

    def _elements(self, body: memoryview) -> Iterator[tuple[int, memoryview]]:
        """Yield type and content of the elements of an array."""
        place = 0
        while place + 8 <= len(body):
            kind, count = struct.unpack_from(f"{self.order}II", body, place)
            place += 8
            if kind >> 16:
                # Up to four bytes are in the tag itself.
                kind, count = kind & 0xFFFF, kind >> 16
                if count > 4:
                    _unsound(self.source, f"a tag is said to hold {count} bytes")
                yield kind, body[place - 4 : place - 4 + count]
                continue
            self.source.check_size("part of an array", count, stored=len(body) - place)
            yield kind, body[place : place + count]
            place += count + (-count % 8)
