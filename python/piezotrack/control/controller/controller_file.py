"""Entry of the feedforward in a controller's JSON file, written and read."""

from __future__ import annotations

import hashlib
import json
import math
from typing import Any

from ... import _core
from ..._support.files.json_text import object_of
from ..._support.messages import quoted
from ...errors import ParameterError
from ...identification.fitted.start import state_entry, state_of
from ...stages.inverse import Inverse
from ...stages.registry import stage_class
from ..laws.neural_network import NETWORK, NetworkInverse
from ..parts.file_entries import only, stage_entry, stage_of

__all__ = ["digest", "inverse_entry", "inverse_of"]


def digest(entry: dict[str, Any]) -> str:
    """SHA-256 of the entry of a stage."""
    text = json.dumps(entry, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def inverse_entry(inverse: Inverse | None, drive: str) -> dict[str, Any] | None:
    """Entry of a feedforward, null where there is none."""
    if inverse is None:
        return None
    entry: dict[str, Any] = {
        "kind": "inverse",
        "stage": stage_entry(inverse.stage, drive),
        "offset_m": float(inverse.offset),
        "delay_s": float(inverse.delay),
        "playback": inverse.playback,
        "settle_periods": int(inverse.settle),
        "initial": None if inverse.initial is None else state_entry(inverse.initial),
    }
    if isinstance(inverse, NetworkInverse):
        numbers = dict(zip(NETWORK, inverse.numbers, strict=True))
        errors = {
            f"{name}_{drive}": None if math.isnan(value) else value
            for name, value in (("trained", inverse.trained), ("held_out", inverse.held_out))
        }
        return entry | {"kind": "network", "numbers": numbers} | errors
    if type(inverse) is not Inverse:
        raise ParameterError(
            "feedforward",
            type(inverse).__name__,
            "pt.Inverse or pt.control.NetworkInverse, which a file can hold",
        )
    return entry


def inverse_of(entry: Any, drive: str) -> Inverse | None:
    """Read a feedforward from its entry."""
    if entry is None:
        return None
    feedforward = object_of("feedforward", entry)
    keys = ["kind", "stage", "offset_m", "delay_s", "playback", "settle_periods", "initial"]
    network = feedforward.get("kind") == "network"
    if not network and feedforward.get("kind") != "inverse":
        kind = quoted(feedforward.get("kind"))
        raise ParameterError("feedforward: kind", kind, "'inverse' or 'network'")
    errors = [f"trained_{drive}", f"held_out_{drive}"]
    only("feedforward", feedforward, [*keys, "numbers", *errors] if network else keys)
    stage = stage_of("feedforward: stage", feedforward["stage"], drive)
    initial = feedforward["initial"]
    given: dict[str, Any] = {
        "stage": stage,
        "offset": _core.as_number("feedforward: offset_m", feedforward["offset_m"]),
        "delay": _core.as_number("feedforward: delay_s", feedforward["delay_s"]),
        "playback": feedforward["playback"],
        "settle": _core.as_count("feedforward: settle_periods", feedforward["settle_periods"]),
        "initial": None
        if initial is None
        else state_of("feedforward: initial", initial, stage_class(stage.info)._state),
    }
    if not network:
        return Inverse(**given)
    numbers = object_of("feedforward: numbers", feedforward["numbers"])
    only("feedforward: numbers", numbers, NETWORK)
    trained, held_out = (
        math.nan if feedforward[key] is None else _core.as_number(key, feedforward[key])
        for key in errors
    )
    values = [numbers[key] for key in NETWORK]
    values[1] = tuple(values[1])
    return NetworkInverse(**given, numbers=tuple(values), trained=trained, held_out=held_out)
