"""Numbers and state of the repetitive part in C, whose functions are in source/repetitive.c."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .laws import rows, share
from .text import Constant, Field, Operations, Part, Setting, Size

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["repetitive"]

# The learning gain is below 2 V/um.
MOST_GAIN = 2e6
# Largest weight of a tap; those of a filter of the measurement add up to 1 at most.
MOST_TAP = 2.0


def repetitive(numbers: Mapping[str, Sequence[float]], unit: str) -> Part:
    """Make the repetitive part; its delay line is an array in the state."""
    pole, gain, period, pause = numbers["repetitive"]
    lead, _, entries, unread, whole = (int(one) for one in numbers["repetitive lengths"])
    taps = numbers["taps"]
    most = max(MOST_TAP, *(2.0 * abs(one) for one in taps))
    count = len(taps)
    names = rows("repetitive_tap", count)
    weights = "weights of the samples of a period ago, oldest first"
    settings = (
        share("REPETITIVE_POLE", pole, "p, of the filter Q"),
        Setting("REPETITIVE_GAIN", gain, "Kq", f"{unit}/m", 0.0, max(MOST_GAIN, gain)),
        Setting("REPETITIVE_TAPS", taps, weights, "1", -most, most, names),
    )
    sizes = [
        Size("REPETITIVE_ENTRIES", entries, "entries of a delay line"),
        Size("REPETITIVE_UNREAD", unread, "oldest entries that no tap reads"),
        Size("REPETITIVE_COUNT", count, "taps"),
    ]
    fields = [
        Field("real", "learnt", f"delay line: uRC + Kq e, {unit}", entries),
        Field("real", "repetitive_volts", f"the last output uRC, {unit}"),
        Field("count", "line_next", "entry of the line that is written next"),
    ]
    constants: tuple[Constant, ...] = ()
    if lead:
        sizes.append(Size("REPETITIVE_LEAD", lead, "samples by which errors are stored earlier"))
    if pause:
        sizes.append(Size("REPETITIVE_WHOLE", whole, "whole samples of a period"))
        ahead = period - whole
        constants = (Constant("REPETITIVE_AHEAD", ahead, "period less its whole samples"),)
        fields += [
            Field("real", "given", f"delay line: uRC, {unit}", entries),
            Field("real", "behind", "samples by which held periods were too short"),
            Field("count", "left", "samples left of a held period, or of resuming"),
            Field("count", "since", "samples since the first clipped one that counts"),
            Field("count", "clipped", "clipped samples that count"),
            Field("count", "inward", "clipped samples whose error points inward"),
            Field("count", "well", "held periods with few clipped samples"),
            Field("flag", "learning", "0 learns, 1 holds what was learnt, 2 resumes"),
        ]
    return Part(
        file="repetitive.c",
        chooses=("REPEATS", *(["LEADS"] if lead else []), *(["PAUSES"] if pause else [])),
        sizes=tuple(sizes),
        settings=settings,
        constants=constants,
        fields=tuple(fields),
        operations=Operations(count + 3, count + 2),
    )
