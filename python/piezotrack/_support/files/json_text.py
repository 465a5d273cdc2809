"""Reading of JSON, and the shapes of what is read."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from ...errors import DataError

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["number_pair", "object_of", "parse_json", "text_of"]


def parse_json(name: str, content: bytes) -> Any:
    """Parse the content of a JSON file.

    Parameters
    ----------
    name : str
        Of the file, for messages.
    content : bytes
        In UTF-8; a byte-order mark, as some editors write it, is left out.

    Returns
    -------
    object
        What it holds.

    Raises
    ------
    DataError
        It is no JSON, or an object names an entry twice.
    """

    def once(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
        members: dict[str, Any] = {}
        for key, value in pairs:
            if key in members:
                raise DataError(f"{name}: the entry '{key}' is there twice: expected it once")
            members[key] = value
        return members

    try:
        return json.loads(content.decode("utf-8-sig"), object_pairs_hook=once)
    except DataError:
        raise
    except RecursionError:
        raise DataError(f"{name} is nested too deep for a file in JSON") from None
    except UnicodeDecodeError:
        raise DataError(f"{name} is not a text file: expected JSON") from None
    except json.JSONDecodeError as error:
        raise DataError(
            f"{name}:{error.lineno}: not JSON: {error.msg}; expected a file that piezotrack saved, "
            "as a model or a controller"
        ) from None
    except ValueError as error:
        raise DataError(f"{name} cannot be read: {error}") from None


def object_of(name: str, value: Any) -> dict[str, Any]:
    """Return an entry of a file that has to be an object; one that is null or missing is empty.

    Raises
    ------
    DataError
        It is something else.
    """
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise DataError(f"{name} is {_shown(value)}: expected an object")
    return value


def text_of(name: str, value: Any) -> str | None:
    """Return an entry of a file that has to be a text or null.

    Raises
    ------
    DataError
        It is something else.
    """
    if value is not None and not isinstance(value, str):
        raise DataError(f"{name} is {_shown(value)}: expected a text or null")
    return value


def number_pair(name: str, value: Any) -> tuple[float, float] | None:
    """Return an entry of a file that has to be two numbers, the lower first, or null.

    Raises
    ------
    DataError
        It is something else.
    """
    if value is None:
        return None
    if isinstance(value, list) and len(value) == 2:
        low, high = value
        if all(type(one) in (int, float) and abs(one) <= 1e300 for one in value) and low <= high:
            return float(low), float(high)
    raise DataError(f"{name} is {_shown(value)}: expected two numbers, the lower first")


def _shown(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
