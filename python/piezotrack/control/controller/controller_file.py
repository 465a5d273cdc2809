"""Controllers as JSON files."""

from __future__ import annotations

import hashlib
import json
import math
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.files import write_document
from ..._support.json_text import object_of
from ..._support.messages import quoted
from ...errors import DataError, ParameterError
from ...identification.fitted.model_entries import parameter_entries
from ...identification.fitted.model_file import (
    entries_of,
    read_content,
    stage_of,
)
from ...identification.fitted.start import state_entry, state_of
from ...stages.inverse import Inverse
from ...stages.registry import model_named, stage_class
from ..laws.file_entries import Setting, only, part_entry, part_of
from ..laws.hysteresis_observer import HysteresisObserver
from ..laws.neural_network import NETWORK, NetworkInverse
from ..loop.stability import LoopCheck, LoopReport
from ..tuning.tuned import Tuned, TuningReport
from .controller import DRIVE_UNITS, Controller

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from ...stages.base import Stage

__all__ = ["load_controller", "save_controller"]

FORMAT = "piezotrack-controller"
SCHEMA_VERSION = 1
LAWS = (
    *("pid", "state-space", "lead-lag", "sliding-mode"),
    *("disturbance-observer", "perturbation-estimator", "scheduled-pid"),
)
OBSERVER = "hysteresis-observer"


def save_controller(
    controller: Controller,
    path: str | os.PathLike[str],
    report: LoopReport | TuningReport | Tuned | None = None,
) -> Path:
    """Write a controller as JSON; arguments and errors as of `Controller.save`."""
    return write_document(path, document_of(controller, report))


def document_of(
    controller: Controller, report: LoopReport | TuningReport | Tuned | None = None
) -> dict[str, Any]:
    """Content of the file of a controller: numbers, texts, lists and dicts only."""
    drive = controller.drive_unit
    forward = _inverse_entry(controller.feedforward, drive)
    law: Any = controller.feedback
    feedback: dict[str, Any] | None = None
    if isinstance(law, HysteresisObserver):
        feedback = _observer_entry(law, drive)
    elif law is not None:
        feedback = part_entry(law, drive)
    learner = controller.repetitive
    return {
        "format": FORMAT,
        "schema_version": SCHEMA_VERSION,
        "drive_unit": drive,
        "dt_s": float(controller.dt),
        f"limits_{drive}": list(controller.limits),
        "span_m": None if controller.span is None else [float(one) for one in controller.span],
        "max_jump_m": None if controller.max_jump is None else _jump(controller.max_jump),
        "feedforward": forward,
        "feedback": feedback,
        "repetitive": None if learner is None else part_entry(learner, drive),
        "filters": [part_entry(one, drive) for one in controller.filters],
        "provenance": {
            "package": "piezotrack",
            "version": _core.__version__,
            "model_sha256": None if forward is None else _digest(forward["stage"]),
            "design": _design(controller, report),
        },
    }


def _jump(value: float) -> float | str:
    return "inf" if math.isinf(value) else float(value)


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
    name, document = read_content(path)
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise DataError(f"{name} is not a piezotrack controller: its 'format' is not '{FORMAT}'")
    version = document.get("schema_version")
    if version != SCHEMA_VERSION or isinstance(version, bool):
        raise DataError(
            f"{name}: schema_version is {quoted(version)}: expected {SCHEMA_VERSION}, which this "
            "version of piezotrack reads"
        )
    with entries_of(name):
        controller = _controller_of(document)
        object.__setattr__(controller, "_provenance", _provenance_of(document))
        return controller


def _controller_of(document: dict[str, Any]) -> Controller:
    drive = document.get("drive_unit")
    if drive not in DRIVE_UNITS:
        raise ParameterError(f"drive_unit is {quoted(drive)}: expected 'V', 'm' or 'N'")
    own = ("dt_s", f"limits_{drive}", "span_m", "max_jump_m")
    parts = ("feedforward", "feedback", "repetitive", "filters")
    keys = ("format", "schema_version", "drive_unit", *own, *parts, "provenance")
    only("", document, keys)
    dt, limits, span, jump = (document[key] for key in own)
    filters = document["filters"]
    if not isinstance(filters, list):
        raise ParameterError(f"filters is {quoted(filters)}: expected a list of filters")
    return Controller(
        dt=_core.as_number("dt_s", dt),
        limits=_pair(own[1], limits),
        span=None if span is None else _pair("span_m", span),
        max_jump=math.inf if jump == "inf" else jump,
        drive_unit=drive,
        feedforward=_inverse_of(document["feedforward"], drive),
        feedback=_feedback_of(document["feedback"], drive),
        repetitive=part_of("repetitive", document["repetitive"], ("repetitive",), drive),
        filters=tuple(
            part_of(f"filters[{i}]", one, ("low-pass", "notch"), drive)
            for i, one in enumerate(filters)
        ),
    )


def _pair(name: str, value: Any) -> tuple[float, float]:
    if not isinstance(value, list) or len(value) != 2:
        raise ParameterError(f"{name} is {quoted(value)}: expected two numbers, the lower first")
    return _core.as_number(name, value[0]), _core.as_number(name, value[1])


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


def _digest(entry: dict[str, Any]) -> str:
    """SHA-256 of the entry of a stage."""
    text = json.dumps(entry, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _inverse_entry(inverse: Inverse | None, drive: str) -> dict[str, Any] | None:
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


def _inverse_of(entry: Any, drive: str) -> Inverse | None:
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


def _observer_entry(law: HysteresisObserver, drive: str) -> dict[str, Any]:
    return {
        "kind": OBSERVER,
        "stage": _stage_entry(law.stage, drive),
        "pid": part_entry(law.pid, drive),
        "correction": float(law.correction),
        "stroke_m": float(law.stroke),
    }


def _feedback_of(entry: Any, drive: str) -> Any:
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


# Where a controller comes from.


def _design(controller: Controller, report: Any) -> dict[str, Any] | None:
    """Margins at design, as a check or a search for gains found them."""
    if report is None:
        known = controller.provenance
        return None if known is None else known.get("design")
    if isinstance(report, Tuned):
        if report.controller != controller:
            raise ParameterError("report is of another controller: expected that of this one")
        report = report.report
    if isinstance(report, TuningReport):
        return {
            "by": "tune",
            "figure": report.figure,
            f"value_{report.unit}": report.value,
            "plants": list(report.plants),
            "kept": [one._asdict() for one in report.kept],
            "binding": list(report.binding),
        }
    if not isinstance(report, LoopReport):
        raise ParameterError(
            f"report is {type(report).__name__}: expected what pt.check_loop or pt.tune returns"
        )
    if report.controller != controller:
        raise ParameterError("report is of another controller: expected that of this one")
    return {"by": "check_loop"} | {name: _margins(one) for name, one in report._cases}


def _margins(one: LoopCheck) -> dict[str, Any]:
    return {
        f"plant_gain_m_per_{one.drive_unit}": one.gain,
        "stable": one.stable,
        "gain_margin": one.gain_margin,
        "phase_margin_rad": one.phase_margin,
        "delay_margin_s": one.delay_margin,
        "crossover_Hz": one.crossover,
        "sensitivity": one.sensitivity,
        "learning_periods": one.periods,
    }


def _provenance_of(document: dict[str, Any]) -> dict[str, Any]:
    found = object_of("provenance", document["provenance"])
    only("provenance", found, ("package", "version", "model_sha256", "design"))
    forward = document["feedforward"]
    expected = None if forward is None else _digest(forward["stage"])
    if found["model_sha256"] not in (None, expected):
        raise ParameterError(
            f"provenance: model_sha256 is {quoted(found['model_sha256'])}: expected {expected!r}, "
            "that of the stage in the file, or null where the stage was changed on purpose"
        )
    return found
