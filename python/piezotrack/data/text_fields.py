"""Fields of a line of a text log: where they are divided, their numbers and their faults."""

from __future__ import annotations

import csv
import math
import re
from typing import TYPE_CHECKING

from .._support.messages import quoted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .columns import Column

__all__ = [
    "are_titles",
    "delimiter_of",
    "field_fault",
    "is_missing",
    "number_of",
    "split_fields",
]

# What programs write where there is no reading; a minus alone too.
MISSING = ("", "nan", "na", "n/a", "null", "none")


def are_titles(fields: Sequence[str]) -> bool:
    """Whether a line has titles: a title may contain a number, and a sample a text."""
    numbers = sum(not math.isnan(number_of(field.replace(",", "."))) for field in fields)
    return 2 * numbers < len(fields)


def delimiter_of(header: str) -> str | None:
    """Return the delimiter outside of quotes; None for blanks."""
    bare = re.sub(r'"[^"]*"', "", header.strip())
    return next((mark for mark in "\t;," if mark in bare), None)


def split_fields(line: str, delimiter: str | None, *, is_header: bool = False) -> list[str]:
    """Divide a line into its fields, at blanks where the delimiter is None."""
    if '"' in line:
        try:
            [fields] = csv.reader([line.strip()], delimiter=delimiter or " ", skipinitialspace=True)
        except csv.Error:
            fields = line.split(delimiter)
    elif is_header and delimiter is None:
        # A unit in brackets belongs to the word before it.
        fields = re.split(r"\s+(?![(\[])", line.strip())
    else:
        fields = line.split(delimiter)
    fields = [field.strip() for field in fields]
    return fields[:-1] if is_header and len(fields) > 1 and not fields[-1] else fields


def number_of(text: str) -> float:
    """Return the number in a field; NaN where there is none."""
    try:
        # Python's 1_000 is no number in a log.
        return math.nan if "_" in text else float(text)
    except ValueError:
        return math.nan


def is_missing(text: str) -> bool:
    """Whether a field says that there is no reading."""
    return text.lower().lstrip("+-") in MISSING


def field_fault(text: str, column: Column, swap: bool) -> str:
    """Describe the fault of a field without a finite number."""
    if not text:
        return f"{column} is empty: expected a number"
    if text.lower().lstrip("+-") in ("nan", "inf", "infinity") or math.isinf(number_of(text)):
        return f"{quoted(text)} in {column} is not a finite number: expected one in each line"
    mark = "comma" if swap else "point"
    other = f": the decimal mark of this log is a {mark}" if "." in text or "," in text else ""
    return f"{quoted(text)} in {column} is not a number{other}"
