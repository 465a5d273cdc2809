"""Elements of C: numbers that are printed exactly, constants, and the fields of a state."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

__all__ = [
    "Constant",
    "Field",
    "Operations",
    "Part",
    "Setting",
    "Size",
    "array_lines",
    "comment_of",
    "constant_text",
    "field_text",
    "in_order",
    "literal",
    "named",
    "named_in",
    "range_literal",
    "size_text",
    "state_bytes",
]

# The largest float.
FLOAT_MOST = float(np.finfo(np.float32).max)
# Numbers in a line of an array.
IN_A_LINE = 2


class Constant(NamedTuple):
    """A constant of the C file: a number, or an array of them.

    Attributes
    ----------
    name : str
        In capitals.
    value : float or sequence of float
        The number or the numbers.
    comment : str
        What it is, with its unit.
    """

    name: str
    value: float | Sequence[float]
    comment: str


class Size(NamedTuple):
    """A count of the C file, which sizes arrays.

    Attributes
    ----------
    name : str
        In capitals.
    value : int
        The count.
    comment : str
        What it counts.
    """

    name: str
    value: int
    comment: str


class Setting(NamedTuple):
    """A number of the law, or an array of them, that is changed while the controller runs.

    Attributes
    ----------
    name : str
        In capitals.
    value : float or sequence of float
        The number or the numbers, of the design.
    comment : str
        What it is.
    unit : str
        Its unit; 1 for none.
    low, high : float
        Range of each of the numbers.
    entries : tuple of str
        Names of the numbers of an array; empty for a single one.
    """

    name: str
    value: float | Sequence[float]
    comment: str
    unit: str
    low: float
    high: float
    entries: tuple[str, ...] = ()

    @property
    def numbers(self) -> list[float]:
        """The numbers, one for a single one."""
        if isinstance(self.value, (int, float)):
            return [float(self.value)]
        return [float(one) for one in self.value]

    @property
    def names(self) -> list[str]:
        """A name for each of the numbers, as an operator sees it."""
        return list(self.entries) if self.entries else [self.name.lower()]

    @property
    def constant(self) -> Constant:
        """The same as a constant."""
        comment = self.comment if self.unit == "1" else f"{self.comment}, {self.unit}"
        return Constant(self.name, self.value, comment)


class Field(NamedTuple):
    """A field of the state.

    Attributes
    ----------
    kind : {"settings", "inverse", "real", "count", "flag"}
        The settings, the state of an inverse, a number, a count or a truth value.
    name : str
        Its name.
    comment : str
        What it is, with its unit.
    entries : int
        Of an array, or numbers of the settings; 0 for a single one.
    """

    kind: str
    name: str
    comment: str
    entries: int = 0


class Operations(NamedTuple):
    """Floating-point operations of a step.

    Attributes
    ----------
    additions, multiplications, divisions : int
        How many; a subtraction counts as an addition.
    """

    additions: int = 0
    multiplications: int = 0
    divisions: int = 0

    def __add__(self, other: Operations) -> Operations:  # type: ignore[override]
        return Operations(*(one + more for one, more in zip(self, other, strict=True)))

    def __str__(self) -> str:
        text = f"{self.additions} additions, {self.multiplications} multiplications"
        return f"{text}, {self.divisions} divisions" if self.divisions else text


NOTHING = Operations()


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of a controller in C.

    Attributes
    ----------
    file : str
        The file of the tree with its functions; NAME_ stands for the name of the export.
    constants : tuple of Constant
        Numbers that they use.
    settings : tuple of Setting
        Numbers that are changed while the controller runs.
    sizes : tuple of Size
        Counts that they use.
    chooses : tuple of str
        Choices of the tree that it makes.
    text : str
        What comes below the constants.
    fields : tuple of Field
        What it keeps from step to step.
    operations : Operations
        Of a step with valid inputs that does not saturate.
    """

    file: str
    constants: tuple[Constant, ...] = ()
    settings: tuple[Setting, ...] = ()
    sizes: tuple[Size, ...] = ()
    chooses: tuple[str, ...] = ()
    text: str = ""
    fields: tuple[Field, ...] = ()
    operations: Operations = NOTHING


def named(name: str, code: str) -> str:
    """Put the name of an export in place of NAME in a piece of C."""
    return re.sub(r"\bNAME(?=_)", name, code)


def named_in(name: str, text: str) -> str:
    """Put the name of an export into a whole file: in capitals for what the compiler replaces."""
    text = re.sub(r"\bNAME(?=_(H|SETTINGS)\b)", name.upper(), text)
    return re.sub(r"\bNAME(?=\.[ch]\b)", name, named(name, text))


def comment_of(text: str) -> str:
    """Make a text one line that a comment of C can hold.

    Neither its end, nor the begin of another, a trigraph, the end of a line or what is not ASCII
    comes through.

    Examples
    --------
    >>> from piezotrack.export.c99.text import comment_of
    >>> comment_of("stage */ ??/")
    'stage * / ? ?/'
    """
    plain = "".join(one if " " <= one <= "~" and one != "\\" else "_" for one in text)
    plain = re.sub(r"\?(?=\?)", "? ", plain)
    return re.sub(r"\*(?=/)", "* ", re.sub(r"/(?=\*)", "/ ", plain))


def literal(value: float, name: str, *, single: bool) -> str:
    """Write a number of C exactly, in hexadecimal, with its decimal in a comment.

    Parameters
    ----------
    value : float
        The number.
    name : str
        The constant, for messages.
    single : bool
        Whether it is rounded to a float.

    Returns
    -------
    str
        As ``0x1.8p+0 /* 1.5 */``.

    Raises
    ------
    ParameterError
        A float has no such number.

    Examples
    --------
    >>> from piezotrack.export.c99.text import literal
    >>> literal(0.1, "GAIN", single=False)
    '0x1.999999999999ap-4 /* 0.1 */'
    >>> literal(0.1, "GAIN", single=True)
    '0x1.99999ap-4f /* 0.1 */'
    """
    value = float(value)
    if not math.isfinite(value):
        raise ParameterError(name, value, "a finite number")
    if not single:
        return f"{_short(value)} /* {value!r} */"
    with np.errstate(over="ignore", under="ignore"):
        rounded = float(np.float32(value))
    if not math.isfinite(rounded) or (rounded == 0.0) != (value == 0.0):
        raise ParameterError(name, f"{value:g}", "a number that a float can have")
    return f"{_short(rounded)}f /* {value!r} */"


def range_literal(value: float, *, single: bool) -> str:
    """Write an end of a range: of floats that which is nearest."""
    if single:
        with np.errstate(over="ignore", under="ignore"):
            value = float(np.clip(np.float32(value), -FLOAT_MOST, FLOAT_MOST))
    return literal(value, "range", single=single)


def _short(value: float) -> str:
    """Return the hexadecimal form without the zeros at the end of the digits."""
    return re.sub(r"\.?0*p", "p", value.hex(), count=1)


def constant_text(constant: Constant, *, single: bool) -> str:
    """Write the definition of a constant, with what it is above."""
    above = f"/* {constant.comment} */\n"
    if isinstance(constant.value, (int, float)):
        number = literal(constant.value, constant.name, single=single)
        return f"{above}static const real {constant.name} = {number.replace(' /*', '; /*', 1)}\n"
    numbers = [literal(value, constant.name, single=single) for value in constant.value]
    size, body = len(numbers), array_lines(numbers)
    return f"{above}static const real {constant.name}[{size}] = {{\n{body}\n}};\n"


def size_text(size: Size) -> str:
    """Write the definition of a count."""
    return f"#define {size.name} {size.value}u /* {size.comment} */\n"


def array_lines(numbers: Iterable[str]) -> str:
    """Write the entries of an array, each with a comma before its comment."""
    entries = [
        number.replace(" /*", ", /*", 1) if "/*" in number else f"{number}," for number in numbers
    ]
    places = range(0, len(entries), IN_A_LINE)
    return "\n".join("    " + " ".join(entries[i : i + IN_A_LINE]) for i in places)


TYPES = {
    "settings": "NAME_settings",
    "inverse": "NAME_inverse",
    "real": "NAME_real",
    "count": "uint32_t",
    "flag": "uint8_t",
}
# Numbers in the state of an inverse: four, and the padding of a truth value.
OF_INVERSE = 5


def field_text(field: Field) -> str:
    """Write the declaration of a field."""
    array = f"[{field.entries}]" if field.entries and field.kind != "settings" else ""
    return f"    {TYPES[field.kind]} {field.name}{array}; /* {field.comment} */\n"


def in_order(fields: Iterable[Field]) -> list[Field]:
    """Put the fields in the order of their sizes, so that none needs padding before it."""
    return sorted(fields, key=lambda one: list(TYPES).index(one.kind))


def state_bytes(fields: Iterable[Field], *, single: bool) -> int:
    """Bytes of a state with these fields, as compilers lay it out.

    Parameters
    ----------
    fields : iterable of Field
        The fields.
    single : bool
        Whether a number has 4 bytes, not 8.

    Returns
    -------
    int
        The bytes, with the padding at the end.
    """
    real = 4 if single else 8
    sizes = {"settings": real, "inverse": OF_INVERSE * real, "real": real, "count": 4, "flag": 1}
    whole = 0
    for one in fields:
        whole += sizes[one.kind] * max(one.entries, 1)
        if one.kind == "settings":
            # Version, layout and checksum, and the padding behind.
            whole += -(-12 // real) * real
    return -(-whole // real) * real
