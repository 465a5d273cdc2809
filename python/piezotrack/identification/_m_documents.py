"""JSON files: written whole, and model files read with a sentence for whatever is wrong."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import _core
from ..errors import DataError, ParameterError, PiezotrackError
from .._support.files import replacing

if TYPE_CHECKING:
    import os
    from collections.abc import Iterator

    from ..data.dataset import Dataset

__all__ = [
    "FORMAT",
    "SCHEMA_VERSION",
    "entries_of",
    "file_number",
    "provenance",
    "read_document",
    "require_unit",
    "write_document",
]

FORMAT = "piezotrack-model"
SCHEMA_VERSION = 1


def write_document(path: str | os.PathLike[str], document: Mapping[str, Any]) -> Path:
    """Write a JSON file, whole or not at all; arguments and errors as of `save`."""
    import json

    text = json.dumps(_finite(document), indent=2, allow_nan=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
    return Path(path)


def read_document(path: str | os.PathLike[str]) -> tuple[str, dict[str, Any]]:
    """Read a model file of any kind of stage.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    name : str
        Of the file, for messages.
    document : dict
        Its content.

    Raises
    ------
    DataError
        The file is missing, is not a model file, or was written by a newer version.
    """
    import json

    try:
        file = Path(path)
    except TypeError:
        raise ParameterError(f"path is {path!r}: expected the name of a file") from None
    try:
        document = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataError(f"{file.name}: {(error.strerror or str(error)).lower()}") from None
    except RecursionError:
        raise DataError(f"{file.name} is not a piezotrack model: it is nested too deep") from None
    except UnicodeDecodeError:
        raise DataError(f"{file.name} is not a text file: expected a model in JSON") from None
    except json.JSONDecodeError as error:
        raise DataError(f"{file.name}:{error.lineno}: not JSON: {error.msg}") from None
    except ValueError as error:
        raise DataError(f"{file.name} cannot be read: {error}") from None
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise DataError(f"{file.name} is not a piezotrack model: its 'format' is not '{FORMAT}'")
    version = document.get("schema_version")
    if version != SCHEMA_VERSION:
        raise DataError(
            f"{file.name} has schema_version {version!r}: this version of piezotrack reads "
            f"{SCHEMA_VERSION}"
        )
    return file.name, document


@contextmanager
def entries_of(name: str) -> Iterator[None]:
    """Say of which file an entry is missing or not as `save` writes it."""
    try:
        yield
    except KeyError as error:
        raise DataError(f"{name}: the entry {error} is missing") from None
    except (TypeError, AttributeError):
        raise DataError(f"{name}: an entry is not of the form that 'save' writes") from None
    except PiezotrackError as error:
        raise DataError(f"{name}: {error}") from None


def provenance(data: Dataset, **settings: Any) -> dict[str, Any]:
    """Say in a file which version and which record a model comes from, and how."""
    return {
        "package": "piezotrack",
        "version": _core.__version__,
        **settings,
        "data": {
            "source": data.source,
            "sha256": data.sha256,
            "samples": len(data),
            "warmup_samples": data.warmup,
            "window_s": [float(data.t[0]), float(data.t[-1])],
            "dt_s": data.dt,
            "drive_range": [float(data.full.u.min()), float(data.full.u.max())],
            "drive_unit": data.drive_unit,
            "hold": data.hold,
        },
    }


def require_unit(name: str, entry: Mapping[str, Any], unit: str) -> None:
    """Refuse an entry that is in another unit than the one that is written."""
    if entry.get("unit") != unit:
        raise ParameterError(f"the unit of {name} is {entry.get('unit')!r}: expected {unit!r}")


def file_number(
    name: str,
    entry: Mapping[str, Any],
    unit: str,
    *,
    above: float = -math.inf,
    least: float = -math.inf,
) -> float:
    """Take a length or a time from the file."""
    require_unit(name, entry, unit)
    value = _core.as_number(name, entry["value"])
    if not math.isfinite(value) or value <= above or value < least:
        limit = " above 0" if above == 0.0 else ", 0 or above" if least == 0.0 else ""
        raise ParameterError(f"{name} is {value} {unit}: expected a finite number{limit}")
    return value


def _finite(value: Any) -> Any:
    """Replace what JSON cannot say, NaN and infinity, by null."""
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
