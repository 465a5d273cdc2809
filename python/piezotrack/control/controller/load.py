"""`load_controller`: controllers from JSON files."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.files.json_text import object_of
from ..._support.messages import quoted
from ...errors import ParameterError
from ...identification.fitted.model_file import checked_content, entries_of
from ..parts.file_entries import only, part_of
from ..parts.part_info import names_of
from .controller import DRIVE_UNITS, FORMAT, SCHEMA_VERSION, Controller
from .controller_file import digest, inverse_of

if TYPE_CHECKING:
    import os

__all__ = ["load_controller"]


def load_controller(path: str | os.PathLike[str]) -> Controller:
    """Read a controller that `Controller.save` has written.

    Every number comes back to the last bit, so the controller does what the saved one does.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    Controller
        The controller; its `provenance` is that of the file.

    Raises
    ------
    DataError
        The file is missing, is not a controller file, was written by a newer version, or has an
        entry that is not known, is in another unit or out of its range. The sentence names it.

    Examples
    --------
    >>> import piezotrack as pt
    >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
    >>> path = loop.save("loop.json")
    >>> pt.load_controller(path) == loop
    True
    """
    name, document = checked_content(path, "controller", FORMAT, SCHEMA_VERSION)
    with entries_of(name):
        controller = _controller_of(document)
        object.__setattr__(controller, "_provenance", _provenance_of(document))
        return controller


def _controller_of(document: dict[str, Any]) -> Controller:
    drive = document.get("drive_unit")
    if drive not in DRIVE_UNITS:
        raise ParameterError("drive_unit", quoted(drive), "'V', 'm' or 'N'")
    numbers = ("dt_s", f"limits_{drive}", "span_m", "max_jump_m")
    parts = ("feedforward", "feedback", "repetitive", "filters")
    keys = ("format", "schema_version", "drive_unit", *numbers, *parts, "provenance")
    only("", document, keys)
    dt, limits, span, jump = (document[key] for key in numbers)
    filters = document["filters"]
    if not isinstance(filters, list):
        raise ParameterError("filters", quoted(filters), "a list of filters")
    return Controller(
        dt=_core.as_number("dt_s", dt),
        limits=_pair(numbers[1], limits),
        span=None if span is None else _pair("span_m", span),
        max_jump=math.inf if jump == "inf" else jump,
        drive_unit=drive,
        feedforward=inverse_of(document["feedforward"], drive),
        feedback=part_of("feedback", document["feedback"], names_of("law"), drive),
        repetitive=part_of("repetitive", document["repetitive"], names_of("repetitive"), drive),
        filters=tuple(
            part_of(f"filters[{i}]", entry, names_of("filter"), drive)
            for i, entry in enumerate(filters)
        ),
    )


def _pair(name: str, value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise ParameterError(name, quoted(value), "two numbers, the lower first")
    return _core.as_number(name, value[0]), _core.as_number(name, value[1])


def _provenance_of(document: dict[str, Any]) -> dict[str, Any]:
    provenance = object_of("provenance", document["provenance"])
    only("provenance", provenance, ("package", "version", "model_sha256", "design"))
    forward = document["feedforward"]
    expected = None if forward is None else digest(forward["stage"])
    if provenance["model_sha256"] not in (None, expected):
        raise ParameterError(
            "provenance: model_sha256",
            quoted(provenance["model_sha256"]),
            f"{expected!r}, that of the stage in the file, or null where the stage was changed "
            "on purpose",
        )
    return provenance
