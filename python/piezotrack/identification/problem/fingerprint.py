"""Hashes of records and settings, by which a result is known again."""

from __future__ import annotations

import json
from collections.abc import Mapping, Set
from dataclasses import asdict, is_dataclass
from hashlib import sha256
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.arguments import has_entries
from ..._support.messages import quoted
from ...errors import ParameterError

if TYPE_CHECKING:
    from ...data.dataset import Dataset

__all__ = ["as_plain_data", "exact_text", "hash_of", "record_hash"]

# Hexadecimal digits of a hash: two in a million million million names would be the same.
DIGITS = 32


def record_hash(data: Dataset) -> str:
    """Hash of a record: samples, window, where it begins, hold and unit of the drive.

    Parameters
    ----------
    data : Dataset
        The record.

    Returns
    -------
    str
        Hexadecimal digits.
    """
    return hash_of([data.sha256, data.hold, data.drive_unit, exact_text(float(data.t[0]))])


def as_plain_data(name: str, value: Any) -> Any:
    """Put an argument in numbers, texts, lists and dicts.

    Parameters
    ----------
    name : str
        The argument, for messages.
    value : Any
        Its value.

    Returns
    -------
    Any
        The same in plain data.

    Raises
    ------
    ParameterError
        There are other things in it.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return as_plain_data(name, asdict(value))
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, np.bool_):
        return bool(value)
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        return float(value)
    if isinstance(value, Mapping):
        return {str(key): as_plain_data(name, entry) for key, entry in value.items()}
    if isinstance(value, Set):
        # Its order is another one in every process.
        return sorted(as_plain_data(name, entry) for entry in value)
    if has_entries(value):
        return [as_plain_data(name, entry) for entry in value]
    raise ParameterError(name, quoted(value), "numbers, texts, lists or mappings")


def exact_text(value: Any) -> Any:
    """Write numbers to the last bit, the same for 1 and 1.0.

    Parameters
    ----------
    value : Any
        Plain data.

    Returns
    -------
    Any
        The same with texts for numbers.
    """
    if isinstance(value, dict):
        return {key: exact_text(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [exact_text(entry) for entry in value]
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        try:
            return float(value).hex()
        except OverflowError:
            return str(value)
    return value


def hash_of(content: Any) -> str:
    """Hash of plain data.

    Parameters
    ----------
    content : Any
        Texts, lists and dicts.

    Returns
    -------
    str
        Hexadecimal digits.
    """
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return sha256(text.encode()).hexdigest()[:DIGITS]
