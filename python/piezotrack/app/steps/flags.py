"""Flags of a record: what is unusual in it, where, and the button that mends it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...data.checks.record_flags import record_flags
from ...data.checks.sampling_rate import spare_factor
from .. import parts
from ..desk import Same

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ...data.checks.log_info import ColumnInfo, LogInfo
    from ...data.checks.record_flags import RecordFlag
    from ...data.dataset import Dataset
    from ..desk import Desk
    from ..parts import Part
    from ..state import LogState

__all__ = ["MARKED", "ROLES", "UNITS", "fixes", "flags", "flags_of", "key", "key_of", "places"]

ROLES = {"time": "Time", "drive": "Drive", "displacement": "Displacement"}
UNITS = {
    "time": ("s", "ms", "us"),
    "drive": ("V", "mV", "kV", "N", "um"),
    "displacement": ("m", "mm", "um", "nm"),
}
# Share of a part that has to be left where something is cut from it.
LEAST_LEFT = 0.2
# Marks of single samples and of ranges that a picture has, at most.
MARKED = 200


def key(index: int, column: ColumnInfo) -> str:
    """Return how the readers are told of a column."""
    return str(index) if column.title == f"column {index}" else column.title


def key_of(found: LogInfo, title: str) -> str | None:
    """Return how the readers are told of the column of a title."""
    return next((key(i, one) for i, one in enumerate(found.columns) if one.title == title), None)


def _chosen(state: LogState, found: LogInfo) -> dict[str, str | None]:
    """Return the columns of the roles, those that were found where none was chosen."""
    return {role: getattr(state, role) or found.roles.get(role) or None for role in ROLES}


def _without_unit(state: LogState, found: LogInfo) -> dict[str, list[tuple[str, str]]]:
    """Return key and title of the columns of each role that have no unit."""
    chosen = _chosen(state, found)
    return {
        role: [
            (key(i, one), one.title)
            for i, one in enumerate(found.columns)
            if chosen[role] in (one.title, key(i, one))
            and not (one.unit or state.units.get(key(i, one)))
        ]
        for role in ROLES
    }


def to_choose(state: LogState, found: LogInfo) -> str:
    """Say which columns and units have yet to be chosen; empty where all are."""
    missing = [
        f"the column of the {ROLES[role].lower()}"
        for role, title in _chosen(state, found).items()
        if title is None and (role != "time" or (state.dt is None and found.time is None))
    ]
    missing += [
        f"the unit of the {ROLES[role].lower()}"
        for role, columns in _without_unit(state, found).items()
        if columns
    ]
    return f"choose {', '.join(missing)} above" if missing else ""


def fixes(state: LogState, found: LogInfo) -> list[Part]:
    """Return buttons for what is probably wrong with a log that is not read."""
    items = [
        _set(f"{title} is {unit}", {"units": {**state.units, known: unit}})
        for role, columns in _without_unit(state, found).items()
        for known, title in columns
        for unit in UNITS[role][:3]
    ]
    if to_choose(state, found):
        return items
    chosen = _chosen(state, found)
    lost = sum(c.missing for c in found.columns if c.title in chosen.values())
    if lost and state.missing is None:
        items.append(_set(f"leave out {lost} missing readings", {"missing": "drop"}))
    time = found.time
    if time is not None and state.resample is None and time.interval > 0.0:
        uneven = bool(time.gaps) or time.jitter > 0.0
        if uneven and not time.backward:
            words = f"interpolate to {1.0 / time.interval:.4g} Hz"
            items.append(_set(words, {"resample": time.interval}))
    return items


def _set(label: str, values: Mapping[str, Any]) -> Part:
    """Return a button that changes settings of the log."""
    return parts.action(label, "set", values, step="log")


def flags_of(desk: Desk, part: Dataset) -> list[RecordFlag]:
    """Return what is unusual in a part of the record, once for each.

    While the window is dragged these are the flags of the part before.
    """
    if not desk.live or desk.flags is None:
        found = desk.result("record flags", [Same(part)], lambda: record_flags(part))
        desk.flags = list({flag.note: flag for flag in found}.values())
    return desk.flags


def _mending(state: LogState, found: LogInfo, part: Dataset, flag: RecordFlag) -> list[Part]:
    """Return the button that mends what is unusual, where there is one."""
    if flag.kind == "swapped":
        drive, displacement = (
            getattr(state, role) or key_of(found, found.roles.get(role, ""))
            for role in ("drive", "displacement")
        )
        return [_set("swap the columns", {"drive": displacement, "displacement": drive})]
    if flag.kind not in ("clipped", "end", "jump") or not flag.spans:
        return []
    # The longest stretch between the places.
    edges = [float(part.t[0]), *(edge for span in flag.spans for edge in span), float(part.t[-1])]
    first, last = max(zip(edges[::2], edges[1::2], strict=True), key=lambda one: one[1] - one[0])
    if last - first < LEAST_LEFT * part.duration:
        return []
    a, b = flag.spans[0]
    words = f"cut {a:.4g} to {b:.4g} s" if len(flag.spans) == 1 else f"cut {len(flag.spans)} places"
    window = float(f"{first:.6g}"), float(f"{last:.6g}")
    return [_set(f"{words}: use {first:.4g} to {last:.4g} s", {"window": window})]


def flags(desk: Desk, found: LogInfo, log: Dataset, part: Dataset) -> Part:
    """Return what a person should know of the record, with what mends it."""
    state = desk.state.log
    items = [
        parts.message("amber", flag.note, *_mending(state, found, part, flag))
        for flag in flags_of(desk, part)
    ]
    items += [
        parts.message("red" if one.verdict == "no" else "amber", one.text)
        for one in found.determines
        if one.subject in ("record", "loop") and one.verdict != "yes"
    ]
    if found.time is not None and found.time.gaps:
        gaps = found.time.gaps
        words = f"{len(gaps)} gaps in the times, from {gaps[0][0]:.4g} to {gaps[0][1]:.4g} s first"
        items.append(parts.message("amber", words))
    factor = desk.result("spare", [Same(log)], lambda: spare_factor(log.u, log.dt))
    if factor > 1:
        lower = 1.0 / (log.dt * factor)
        words = f"{1.0 / log.dt:.4g} Hz are more than the drive needs"
        fix = _set(f"thin to {lower:.4g} Hz", {"decimate": state.decimate * factor})
        items.append(parts.message("amber", words, fix))
    if state.decimate > 1 or state.resample is not None:
        words = f"read at {1.0 / log.dt:.4g} Hz"
        fix = _set("take all samples", {"decimate": 1, "resample": None})
        items.append(parts.message("grey", words, fix))
    if not items:
        items = [parts.message("green", "nothing unusual was found in this part of the record")]
    return parts.messages("flags", *items)


def places(desk: Desk, part: Dataset, kind: str) -> list[Part]:
    """Mark where something is unusual."""
    spans = [span for flag in flags_of(desk, part) if flag.kind == kind for span in flag.spans]
    word = {"clipped": "clipped", "end": "at its end", "jump": "jump"}[kind]
    return [parts.region(a, b, word, "bad") for a, b in spans[:MARKED]]
