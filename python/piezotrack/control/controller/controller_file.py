"""Entries of a controller's JSON file: its stage, its inverse, its feedback; written and read."""

from __future__ import annotations

import hashlib
import json
import math
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.json_text import object_of
from ..._support.messages import quoted
from ...errors import ParameterError
from ...identification.fitted.model_file import parameter_entries, stage_of
from ...identification.fitted.start import state_entry, state_of
from ...stages.inverse import Inverse
from ...stages.registry import model_named, stage_class
from ..laws.file_entries import Setting, only, part_entry, part_of
from ..laws.hysteresis_observer import HysteresisObserver
from ..laws.neural_network import NETWORK, NetworkInverse

if TYPE_CHECKING:
    from ...stages.base import Stage

__all__ = ["digest", "feedback_entry", "feedback_of", "inverse_entry", "inverse_of"]

LAWS = (
    *("pid", "state-space", "lead-lag", "sliding-mode"),
    *("disturbance-observer", "perturbation-estimator", "scheduled-pid"),
)
OBSERVER = "hysteresis-observer"


# Stages, and what is made of them.


def _stage_entry(stage: Stage, drive: str) -> dict[str, Any]:
    return {"model": stage.info.name, "parameters": parameter_entries(stage, drive)}


def _stage_of(place: str, entry: Any, drive: str) -> Stage:
    found = object_of(place, entry)
    only(place, found, ("model", "parameters"))
    info = model_named(found["model"])
    parameters = object_of(f"{place}: parameters", found["parameters"])
    known = [one.name for one in info.parameters]
    only(f"{place}: parameters", parameters, known)
    for name, one in parameters.items():
        only(f"{place}: {name}", object_of(name, one), ("value", "unit", "symbol"))
    return stage_of(info, parameters, drive)


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
        "stage": _stage_entry(inverse.stage, drive),
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
            f"feedforward is {type(inverse).__name__}: expected pt.Inverse or "
            "pt.control.NetworkInverse, which a file can hold"
        )
    return entry


def inverse_of(entry: Any, drive: str) -> Inverse | None:
    """Read a feedforward from its entry."""
    if entry is None:
        return None
    found = object_of("feedforward", entry)
    keys = ["kind", "stage", "offset_m", "delay_s", "playback", "settle_periods", "initial"]
    network = found.get("kind") == "network"
    if not network and found.get("kind") != "inverse":
        kind = quoted(found.get("kind"))
        raise ParameterError(f"feedforward: kind is {kind}: expected 'inverse' or 'network'")
    errors = [f"trained_{drive}", f"held_out_{drive}"]
    only("feedforward", found, [*keys, "numbers", *errors] if network else keys)
    stage = _stage_of("feedforward: stage", found["stage"], drive)
    initial = found["initial"]
    given: dict[str, Any] = {
        "stage": stage,
        "offset": _core.as_number("feedforward: offset_m", found["offset_m"]),
        "delay": _core.as_number("feedforward: delay_s", found["delay_s"]),
        "playback": found["playback"],
        "settle": _core.as_count("feedforward: settle_periods", found["settle_periods"]),
        "initial": None
        if initial is None
        else state_of("feedforward: initial", initial, stage_class(stage.info)._state),
    }
    if not network:
        return Inverse(**given)
    numbers = object_of("feedforward: numbers", found["numbers"])
    only("feedforward: numbers", numbers, NETWORK)
    trained, held_out = (
        math.nan if found[key] is None else _core.as_number(key, found[key]) for key in errors
    )
    values = [numbers[key] for key in NETWORK]
    values[1] = tuple(values[1])
    return NetworkInverse(**given, numbers=tuple(values), trained=trained, held_out=held_out)


def feedback_entry(law: Any, drive: str) -> dict[str, Any] | None:
    """Entry of a feedback law, null where there is none."""
    if isinstance(law, HysteresisObserver):
        return _observer_entry(law, drive)
    return None if law is None else part_entry(law, drive)


def _observer_entry(law: HysteresisObserver, drive: str) -> dict[str, Any]:
    return {
        "kind": OBSERVER,
        "stage": _stage_entry(law.stage, drive),
        "pid": part_entry(law.pid, drive),
        "correction": float(law.correction),
        "stroke_m": float(law.stroke),
    }


def feedback_of(entry: Any, drive: str) -> Any:
    """Read a feedback law from its entry."""
    if not isinstance(entry, dict) or entry.get("kind") != OBSERVER:
        if isinstance(entry, dict) and entry.get("kind") not in LAWS:
            expected = ", ".join(map(repr, (*LAWS, OBSERVER)))
            raise ParameterError(
                f"feedback: kind is {quoted(entry.get('kind'))}: expected one of {expected}"
            )
        return part_of("feedback", entry, LAWS, drive)
    only("feedback", entry, ("kind", "stage", "pid", "correction", Setting("stroke", "m").key("V")))
    stage: Any = _stage_of("feedback: stage", entry["stage"], drive)
    return HysteresisObserver(
        stage=stage,
        pid=part_of("feedback: pid", entry["pid"], ("pid",), drive),
        correction=_core.as_number("feedback: correction", entry["correction"]),
        stroke=_core.as_number("feedback: stroke_m", entry["stroke_m"]),
    )
