"""The feedforward in C: a table of one period, or the inverse of a Dahl stage sample by sample."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING

from .laws import along_operations
from .text import Constant, Field, Operations, Part, Size

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["INVERSE_TERMS", "dahl_inverse", "square_root", "voltage_table"]

# As in rust/control/src/inverse: terms of the series, pieces of a way.
INVERSE_TERMS = 4
MOST_PIECES = 2000.0


def voltage_table(voltages: Sequence[float], unit: str) -> Part:
    """Make a feedforward that is played from a table of one period."""
    return Part(
        file="feedforward/table.c",
        chooses=("FORWARD_TABLE",),
        sizes=(Size("TABLE_SAMPLES", len(voltages), "samples of a period"),),
        constants=(Constant("TABLE", voltages, f"feedforward of one period, {unit}"),),
        fields=(
            Field("count", "place", "sample of the table that is played next: set it to shift"),
        ),
    )


def square_root() -> Part:
    """Make a square root that is rounded correctly, as no library is used."""
    return Part(file="feedforward/square_root.c")


def dahl_inverse(
    numbers: Sequence[float], dt: float, offset: float, delay: float, unit: str, *, single: bool
) -> Part:
    """Make the inverse of a Dahl stage, with offset and delay of its sensor."""
    inertia, damping, stiffness, level, friction, a1, a2, gain, piece = numbers
    largest = 3e38 if single else sys.float_info.max
    longest = piece if math.isfinite(piece) else largest
    delayed = delay > 0.0
    constants = [
        Constant("INVERSE_INERTIA", inertia, f"M/T, {unit} s^2/m"),
        Constant("INVERSE_DAMPING", damping, f"D/T, {unit} s/m"),
        Constant("INVERSE_STIFFNESS", stiffness, f"K/T, {unit}/m"),
        Constant("INVERSE_LEVEL", level, f"b1/T, {unit} for one unit of the force"),
        Constant("INVERSE_FRICTION", friction, f"b0/T, {unit} for one unit of the slope"),
        Constant("INVERSE_PIECE", longest, "longest way in one piece, m"),
        Constant("INVERSE_LONGEST", min(MOST_PIECES * longest, largest), "longest way, m"),
        Constant("INVERSE_PROBE", 1e-9, "step that shows the slope of the inverse, m"),
        Constant("DRIVE_SAME", 2.0**-21 if single else 2.0**-40, "difference that counts as none"),
        Constant("REFERENCE_DT", dt, "Ts, s"),
        Constant("REFERENCE_DT_SQUARED", dt * dt, "Ts^2, s^2"),
        Constant("REFERENCE_OFFSET", offset, "reading of the sensor at rest, m"),
        Constant("INVERSE_A1", a1, "a1, 1/m"),
        Constant("INVERSE_A2", a2, "a2, 1/m^2"),
        Constant("INVERSE_GAIN", gain, "curvature of the branch from rest"),
    ]
    if delayed:
        constants.append(Constant("REFERENCE_DELAY", delay, "delay that is compensated, s"))
        constants.append(Constant("REFERENCE_HALF_DELAY", 0.5 * delay, "half of it, s"))
    ahead = Operations(4, 3) if delayed else Operations()
    return Part(
        file="feedforward/dahl_inverse.c",
        chooses=("FORWARD_ONLINE", "DAHL_OPERATOR", *(["DELAYED"] if delayed else [])),
        sizes=(Size("INVERSE_MOST_PIECES", int(MOST_PIECES) + 1, "pieces of the longest way"),),
        constants=tuple(constants),
        fields=(
            Field("inverse", "inverse", "state of the inverse"),
            Field("inverse", "before", "the same before the last sample"),
            Field("real", "target", "displacement, velocity, acceleration of the sample", 3),
            Field("real", "off", "deviation of the stage from the reference, and its velocity", 2),
            Field("real", "off_before", "the same a sample before", 2),
            Field("real", "past", "the last two references, m", 2),
            Field("flag", "has_target", "whether the target is finite"),
            Field("flag", "has_past", "whether there was a reference"),
        ),
        operations=ahead + along_operations(INVERSE_TERMS) + Operations(9, 12, 2),
    )
