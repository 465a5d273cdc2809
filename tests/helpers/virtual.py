"""Virtual stages with some of their numbers changed, in whichever part these are."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import piezotrack as pt

PARTS = ("stage", "amplifier", "sensor")


def changed(stage: pt.VirtualStage, /, **changes: Any) -> pt.VirtualStage:
    """Change numbers of the stage's parts, or parts as a whole."""
    of_stage = {one.name for one in fields(stage)}
    parts = {name: value for name, value in changes.items() if name in of_stage}
    for name in PARTS:
        part: Any = parts.get(name, getattr(stage, name))
        if not is_dataclass(part) or isinstance(part, type):
            continue
        names = {one.name for one in fields(part)} - of_stage
        inside = {key: value for key, value in changes.items() if key in names}
        if inside:
            parts[name] = replace(part, **inside)
    unknown = set(changes) - of_stage - {n for p in PARTS for n in vars(getattr(stage, p))}
    assert not unknown, unknown
    return replace(stage, **parts)
