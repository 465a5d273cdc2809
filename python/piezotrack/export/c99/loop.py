"""Numbers and state of what composes the parts in C, whose functions are in source/loop.c."""

from __future__ import annotations

from typing import NamedTuple

from .text import Constant, Field, Operations, Part

__all__ = ["Shape", "loop"]

# As in rust/control: share of the range within which a reported voltage counts as the command.
READING = 0.01


class Shape(NamedTuple):
    """Description of the parts for the functions that compose the loop.

    Attributes
    ----------
    law : str
        Kind of the feedback law; empty without one.
    repeats, pauses : bool
        Whether there is a repetitive part, and whether it pauses under saturation.
    filtered : bool
        Whether there are filters.
    forward : {"given", "table", "online"}
        Where the feedforward comes from: the caller, a table, the inverse of a Dahl stage.
    """

    law: str
    repeats: bool
    pauses: bool
    filtered: bool
    forward: str


def loop(limits: tuple[float, float], unit: str, shape: Shape, told: int) -> Part:
    """Make the functions that the caller calls.

    Parameters
    ----------
    limits : (float, float)
        Lowest and highest command.
    unit : str
        Their unit.
    shape : Shape
        The other parts.
    told : int
        Additions for what the law is told besides error and excess.

    Returns
    -------
    Part
        It comes after the other parts.
    """
    low, high = limits
    width = high - low
    constants = [
        Constant("FAR_LOW", low - width, f"limits less their range: no feedforward below, {unit}"),
        Constant("FAR_HIGH", high + width, f"limits and their range: none above, {unit}"),
    ]
    if shape.pauses or shape.forward == "online":
        constants.append(
            Constant("APPLIED_NEAR", READING * width, f"a reported one as the command, {unit}")
        )
    unlearnt = Field("real", "unlearnt", "error that is yet to be learnt, m")
    fields = (
        Field("real", "present", f"command to go on from, {unit}"),
        Field("real", "excess", f"command applied less the unclipped one, {unit}"),
        *([unlearnt] if shape.repeats else []),
        Field("flag", "has_present", "whether there is a command to go on from"),
        Field("flag", "stepped", "whether there was a step"),
        Field("flag", "reported", "whether the excess is of a reported voltage"),
        Field("flag", "apart", "whether the next sample is the first after a start or a report"),
    )
    return Part(
        file="loop.c",
        constants=tuple(constants),
        fields=fields,
        # Error, sum of the parts and excess.
        operations=Operations(3 + int(shape.repeats) + told),
    )
