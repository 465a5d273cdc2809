"""Numbers and states of the feedback laws in C, whose functions are in source/laws."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from .text import Constant, Field, Operations, Part, Setting, Size

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    Numbers = Mapping[str, Sequence[float]]

__all__ = [
    "Scale",
    "along_operations",
    "dahl_observer",
    "dahl_operator",
    "damping",
    "disturbance_observer",
    "pid",
    "rows",
    "share",
    "sliding_mode",
    "state_space",
]

# Terms of the power series of an operator of the observer, as in source/laws/dahl_observer.c.
TERMS = 6
# A number without a range of its own: this many times larger or smaller than that of the design.
WIDE = 2.0**20


class Scale(NamedTuple):
    """Unit and size of the gains of a law.

    Attributes
    ----------
    unit : str
        Unit of the drive.
    most : float
        The largest gain: the whole range of the limits for 1 nm.
    range : float
        Range of the limits.
    """

    unit: str
    most: float
    range: float

    def gain(self, name: str, value: float, comment: str) -> Setting:
        """Make a gain from the error to the drive."""
        most = max(self.most, 2.0 * abs(value))
        return Setting(name, value, comment, f"{self.unit}/m", -most, most)


def share(name: str, value: float, comment: str, most: float = 1.0) -> Setting:
    """Make a number from 0 to 1, or to `most`."""
    return Setting(name, value, comment, "1", min(0.0, value), max(most, value))


def signed(name: str, value: float, comment: str, unit: str) -> Setting:
    """Make a number that keeps its sign, and is never 0 where it is none."""
    ends = sorted((value / WIDE, value * WIDE)) if value else (-WIDE, WIDE)
    return Setting(name, value, comment, unit, *ends)


def free(
    name: str,
    value: float | Sequence[float],
    comment: str,
    unit: str = "1",
    entries: tuple[str, ...] = (),
) -> Setting:
    """Make numbers of any sign."""
    every = [value] if isinstance(value, (int, float)) else value
    most = WIDE * (max(abs(one) for one in every) or 1.0)
    return Setting(name, value, comment, unit, -most, most, entries)


def rows(name: str, count: int, columns: int = 0) -> tuple[str, ...]:
    """Name the entries of a vector, or of a matrix row by row, from 1 on."""
    places = range(1, count + 1)
    if not columns:
        return tuple(f"{name}_{i}" for i in places)
    return tuple(f"{name}_{i}_{k}" for i in places for k in range(1, columns + 1))


def coefficient(name: str, value: float, comment: str, most: float) -> Setting:
    """Make a coefficient of a stable filter."""
    most = max(most, abs(value))
    return Setting(name, value, comment, "1", -most, most)


def pid(numbers: Numbers, scale: Scale) -> Part:
    """Make the incremental PID with back-calculation."""
    proportional, integral, derivative, tracking = numbers["pid"]
    unit = scale.unit
    return Part(
        file="laws/pid.c",
        chooses=("LAW_ANY", "LAW_PID"),
        settings=(
            scale.gain("PID_PROPORTIONAL", proportional, "Kp"),
            scale.gain("PID_INTEGRAL", integral, "Kp Ts/Ti"),
            scale.gain("PID_DERIVATIVE", derivative, "Kp Td/Ts"),
            share("PID_TRACKING", tracking, "Ts/Tt, of the antiwindup", 2.0),
        ),
        fields=(
            Field("real", "pid_volts", f"output, {unit}"),
            Field("real", "pid_e1", "the last error, m"),
            Field("real", "pid_e2", "the error before it, m"),
            Field("flag", "pid_begun", "whether there was an error"),
        ),
        operations=Operations(7, 4),
    )


def state_space(numbers: Numbers, scale: Scale) -> Part:
    """Make the law in state space."""
    n = len(numbers["b"])
    back = "back" in numbers
    unit = scale.unit
    settings = [
        free("LAW_A", numbers["a"], "A, row by row", entries=rows("law_a", n, n)),
        free("LAW_B", numbers["b"], "B", entries=rows("law_b", n)),
        free("LAW_C", numbers["c"], "C", entries=rows("law_c", n)),
        scale.gain("LAW_D", numbers["d"][0], "D"),
    ]
    if back:
        names = rows("law_back", n)
        settings.append(free("LAW_BACK", numbers["back"], "l, of the antiwindup", entries=names))
    return Part(
        file="laws/state_space.c",
        chooses=("LAW_ANY", "LAW_SPACE", *(["BACK"] if back else [])),
        sizes=(Size("LAW_STATES", n, "states"),),
        settings=tuple(settings),
        fields=(
            Field("real", "law_x", "the states", n),
            Field("real", "law_error", "the last error, m"),
            Field("real", "law_first", f"output to begin with, {unit}"),
            Field("real", "law_offset", f"constant part of the output, {unit}"),
            Field("flag", "law_begun", "whether there was an error"),
            Field("flag", "law_starts", "whether there is an output to begin with"),
        ),
        operations=_state_space_operations(n, back=back),
    )


def _state_space_operations(n: int, *, back: bool) -> Operations:
    dot = Operations(n, n)
    rows = Operations(n * (n + 1), n * (n + 1))
    output = dot + Operations(2, 1)
    if back:
        return rows + Operations(n, n) + output
    return rows + dot + dot + Operations(1, 1) + output


def sliding_mode(numbers: Numbers, scale: Scale) -> Part:
    """Make sliding mode control with a boundary layer."""
    switching, gain, integral, derivative, fresh = numbers["sliding-mode"]
    unit = scale.unit
    most = max(scale.range, 2.0 * switching)
    return Part(
        file="laws/sliding_mode.c",
        chooses=("LAW_ANY", "LAW_SLIDING"),
        settings=(
            Setting("SLIDING_SWITCHING", switching, "eta, the largest output", unit, 0.0, most),
            signed("SLIDING_GAIN", gain, "eta/phi, inside of the layer", f"{unit}/m"),
            share("SLIDING_INTEGRAL", integral, "Ts/Ti", WIDE),
            share("SLIDING_DERIVATIVE", derivative, "Td/Ts", WIDE),
            share("SLIDING_FRESH", fresh, "share of a new difference in the filtered one"),
        ),
        fields=(
            Field("real", "sliding_integral", "integral part of the surface, m"),
            Field("real", "sliding_change", "filtered change of the error in a sample, m"),
            Field("real", "sliding_error", "the last error, m"),
            Field("real", "sliding_base", f"output to begin with, {unit}"),
            Field("real", "sliding_volts", f"the last output, {unit}"),
            Field("flag", "sliding_begun", "whether there was an error"),
            Field("flag", "sliding_starts", "whether there is an output to begin with"),
        ),
        operations=Operations(8, 6),
    )


def disturbance_observer(numbers: Numbers, scale: Scale) -> Part:
    """Make the disturbance observer around a PID or sliding mode control."""
    fresh, pole, inverse = numbers["disturbance-observer"]
    unit = scale.unit
    return Part(
        file="laws/disturbance_observer.c",
        chooses=("LAW_DISTURBANCE", "TOLD_APPLIED", "TOLD_FEEDFORWARD"),
        settings=(
            share("OBSERVER_FRESH", fresh, "1 - q, of the filter of the estimate"),
            share("OBSERVER_POLE", pole, "p, of the nominal plant"),
            signed("OBSERVER_INVERSE", inverse, "1/(g (1 - p))", f"{unit}/m"),
        ),
        fields=(
            Field("real", "observer_disturbance", f"d, {unit}"),
            Field("real", "observer_error", "error of the last sample, m"),
            Field("real", "observer_feedforward", f"feedforward of the last sample, {unit}"),
            Field("real", "observer_first", f"output to begin with, {unit}"),
            Field("real", "observer_volts", f"the last output, {unit}"),
            Field("flag", "observer_begun", "whether there was a sample"),
            Field("flag", "observer_starts", "whether there is an output to begin with"),
        ),
        operations=Operations(6, 4),
    )


def damping(numbers: Numbers, scale: Scale, *, follows: bool) -> Part:
    """Make the damping filter beside the PID; `follows` of the deviation, beside an inverse."""
    b0, b1, b2, a1, a2 = numbers["damping"]
    unit = scale.unit
    origin = (
        Field("real", "damping_origin", "the first reading, m"),
        Field("flag", "damping_begun", "whether there was a reading"),
    )
    return Part(
        file="laws/damping.c",
        chooses=("LAW_DAMPED", "FOLLOWS" if follows else "TOLD_MEASURED"),
        settings=(
            scale.gain("DAMPING_B0", b0, "K = (b0 + b1/z + b2/z^2)/(1 + a1/z + a2/z^2)"),
            scale.gain("DAMPING_B1", b1, "b1"),
            scale.gain("DAMPING_B2", b2, "b2"),
            coefficient("DAMPING_A1", a1, "of the poles", 2.0),
            coefficient("DAMPING_A2", a2, "of the poles", 1.0),
        ),
        fields=(
            Field("real", "damping_s1", f"memory of the filter, {unit}"),
            Field("real", "damping_s2", f"memory of the filter, {unit}"),
            Field("real", "damping_volts", f"the last output, {unit}"),
            *(() if follows else origin),
        ),
        operations=Operations(6 - follows, 5),
    )


def dahl_observer(numbers: Numbers, scale: Scale) -> Part:
    """Make the observer of a Dahl hysteresis around a PID."""
    pole, fresh, correction, a1, a2, gain, longest = numbers["dahl-observer"]
    unit = scale.unit
    return Part(
        file="laws/dahl_observer.c",
        chooses=("LAW_DAHL", "DAHL_OPERATOR", "TOLD_MEASURED", "TOLD_APPLIED"),
        settings=(
            share("OBSERVER_POLE", pole, "p, of the linear part"),
            signed("OBSERVER_FRESH", fresh, "g (1 - p)", f"m/{unit}"),
            share("OBSERVER_CORRECTION", correction, "L, share that corrects the estimate"),
            signed("OBSERVER_PIECE", longest, "longest way in one piece", "m"),
            free("HYSTERESIS_A1", a1, "a1", "1/m"),
            free("HYSTERESIS_A2", a2, "a2", "1/m^2"),
            free("HYSTERESIS_GAIN", gain, "curvature of the branch from rest", f"{unit}/m^2"),
        ),
        fields=(
            Field("real", "hysteresis_force", f"estimated hysteresis w, {unit}"),
            Field("real", "hysteresis_slope", f"its slope along the path, {unit}/m"),
            Field("real", "observer_displacement", "estimated displacement, m"),
            Field("real", "observer_place", "place of the operator on its path, m"),
            Field("real", "observer_first", f"output to begin with, {unit}"),
            Field("real", "observer_volts", f"the last output, {unit}"),
            Field("flag", "observer_begun", "whether there was a sample"),
            Field("flag", "observer_starts", "whether there is an output to begin with"),
        ),
        # One piece: the way, and what is left of it.
        operations=along_operations(TERMS) + Operations(11, 5, 1),
    )


def dahl_operator(terms: int) -> Part:
    """Make the function that moves a Dahl operator along a monotone piece of its path.

    Parameters
    ----------
    terms : int
        Of the longest power series.

    Returns
    -------
    Part
        It comes before the observer and the inverse.
    """
    reciprocals = [1.0 / max(k, 1) for k in range(terms + 1)]
    return Part(
        file="dahl_operator.c",
        chooses=("DAHL_OPERATOR",),
        sizes=(Size("DAHL_TERMS", terms, "terms of the longest series"),),
        constants=(Constant("DAHL_RECIPROCAL", reciprocals, "1/k, k from 1"),),
    )


def along_operations(terms: int) -> Operations:
    """Count the operations of a piece of the way."""
    series = 2 + (terms - 2)
    horner = (terms - 1) + (terms - 2)
    return Operations(series + horner + 2, 3 + 2 * (terms - 2) + 2 * horner + 2)
