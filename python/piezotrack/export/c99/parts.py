"""Which parts of a controller have a form in C, and in which order they come."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.arrays import signal_of
from ..._support.units import of_drive
from ...control.laws.neural_network import NetworkInverse
from ...control.loop.preconditions import check_period, check_turns
from ...errors import DataError, ParameterError, ShapeError
from .dahl import dahl_observer
from .input import filters, helpers, readings
from .inverse import dahl_inverse, voltage_table
from .laws import damping, disturbance_observer, pid, sliding_mode, state_space
from .loop import Shape, loop, sample
from .repetitive import repetitive

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from ...control.controller.controller import Controller
    from ...references.reference import Reference
    from .text import Part

__all__ = ["coefficients_of", "feedforward_table", "parts_of", "shape_of"]

Numbers = dict[str, Any]
# With what the functions of a law begin, and what it is told besides error and excess.
FUNCTIONS: dict[str, tuple[str, tuple[str, ...]]] = {
    "pid": ("pid", ()),
    "state-space": ("law", ()),
    "lead-lag": ("law", ()),
    "sliding-mode": ("sliding", ()),
    "disturbance-observer": ("observer", ("applied", "feedforward")),
    "perturbation-estimator": ("observer", ("applied", "feedforward")),
    "hysteresis-observer": ("observer", ("measured", "applied")),
    "integral-resonant": ("damping", ("measured",)),
    "positive-position": ("damping", ("measured",)),
    "positive-velocity-position": ("damping", ("measured",)),
}
# The coefficients of a law that has a form in C: of itself, or of the law inside.
FIRST = {"pid", "b", "sliding-mode"}
# Longest table: its text has 50 bytes a sample.
MOST_SAMPLES = 1_000_000


def coefficients_of(controller: Controller) -> Numbers:
    """Return the numbers of every part as it is sampled, by name; of the filters a list."""
    numbers_of: Numbers = {"filters": []}
    for name, numbers in controller._core.coefficients():
        if name == "filter":
            numbers_of["filters"].append(numbers)
        else:
            numbers_of[name] = numbers
    return numbers_of


def feedforward_table(
    controller: Controller, reference: Reference | None, given: ArrayLike | None = None
) -> list[float] | None:
    """Return one period of the feedforward: that which is given, or the inverse's; None for none.

    Parameters
    ----------
    controller : Controller
        The controller.
    reference : Reference or None
        Motion for which the inverse makes it, settled.
    given : array_like, shape (n,), optional
        The voltages themselves, in the unit of the drive.

    Returns
    -------
    list of float or None
        Voltages at the samples of a period.

    Raises
    ------
    ParameterError
        The controller has no feedforward, the reference has no whole period, or not that of the
        repetitive part; both are given.
    DataError, ShapeError
        What is given is no table for these limits.
    """
    if given is not None:
        if reference is not None:
            raise ParameterError("reference", "given beside table", "one of them")
        return _given_table(controller, given)
    if reference is None:
        return None
    if controller.feedforward is None:
        raise ParameterError("reference", "given, but the controller has no feedforward", "none")
    if reference.period is None:
        raise ParameterError(
            "reference",
            f"({reference.name}), which does not repeat",
            "one that does, for its table",
        )
    samples = reference.period / controller.dt
    if abs(samples - round(samples)) > 1e-6:
        raise ParameterError(
            f"reference ({reference.name})",
            f"a period of {reference.period:g} s",
            f"a whole number of samples of {controller.dt:g} s, for its table",
            verb="has",
        )
    check_period(controller, reference)
    table = controller.feedforward.table(reference, controller.dt, limits=controller.limits)
    return [float(one) for one in table]


def _given_table(controller: Controller, given: ArrayLike) -> list[float]:
    """Check a table of the caller's."""
    table = signal_of("table", given)
    low, high = controller.limits
    if not 1 <= table.size <= MOST_SAMPLES:
        raise ShapeError("table", f"{table.size} samples", f"1 to {MOST_SAMPLES}")
    far = np.flatnonzero((table < low) | (table > high))
    if far.size:
        unit = controller.drive_unit
        raise DataError(
            f"table[{far[0]}] is {table[far[0]]:g} {unit}: expected voltages within the limits, "
            f"{low:g} to {high:g} {unit}"
        )
    check_turns(controller, table.size * controller.dt, "table")
    return [float(one) for one in table]


def shape_of(controller: Controller, table: Sequence[float] | None) -> Shape:
    """Tell which parts there are.

    Raises
    ------
    ParameterError
        A part has no form in C.
    """
    learner = controller.repetitive
    name, sample = _law_of(controller)
    forward = "given"
    if table is not None:
        forward = "table"
    elif controller.feedforward is not None:
        _check_online(controller)
        forward = "online"
    return Shape(
        law=name,
        sample=sample,
        repeats=learner is not None,
        pauses=learner is not None and learner.pause,
        filtered=bool(controller.filters),
        forward=forward,
    )


def _law_of(controller: Controller) -> tuple[str, tuple[str, ...]]:
    """With what the functions of a law begin, and what it is told besides error and excess."""
    law = controller.feedback
    if law is None:
        return "", ()
    # The core has no coefficients of what needs more than arithmetic.
    if law.info.name in FUNCTIONS and coefficients_of(controller).keys() & FIRST:
        return FUNCTIONS[law.info.name]
    what = law.info.title
    if (stage := getattr(law, "stage", None)) is not None:
        what += f" of a {stage.info.title} stage"
    raise ParameterError(
        "feedback",
        f"a {what}, which has no form in C, as its step needs powers or logarithms",
        "a PID, also with damping, state space, lead-lag, sliding mode, a disturbance observer or "
        "the hysteresis observer of a Dahl stage, or to='library', which has all",
    )


def _check_online(controller: Controller) -> None:
    """Refuse an inverse that has no form in C sample by sample."""
    inverse = controller.feedforward
    assert inverse is not None
    if isinstance(inverse, NetworkInverse):
        what = "a neural network"
    elif inverse._begun(controller.dt).coefficients() is None:
        creeps = inverse.stage.info.name == "dahl"
        what = f"the inverse of a {inverse.stage.info.title} stage{' with creep' if creeps else ''}"
    else:
        return
    raise ParameterError(
        "feedforward",
        f"{what}, which has no form in C sample by sample",
        "reference=, a motion that repeats, whose table is written, a Dahl stage without "
        "creep, or to='library', which has all",
    )


def parts_of(
    controller: Controller, table: Sequence[float] | None, *, single: bool
) -> tuple[Part, ...]:
    """Make the parts of a controller in C, each before what calls it.

    Parameters
    ----------
    controller : Controller
        The controller.
    table : sequence of float or None
        One period of the feedforward.
    single : bool
        Whether numbers are floats.

    Returns
    -------
    tuple of Part
        The parts.

    Raises
    ------
    ParameterError
        A part has no form in C.
    """
    numbers, unit = coefficients_of(controller), of_drive("V", controller.drive_unit)
    if controller.drive_unit == "N":
        unit = "N"
    shape = shape_of(controller, table)
    low, high = numbers["span"]
    parts = [readings(low, high, controller.max_jump)]
    if shape.filtered:
        parts.append(filters(numbers["filters"]))
    if shape.law:
        parts += [sample(shape), *_laws(numbers, unit)]
    if shape.repeats:
        parts.append(repetitive(numbers, unit))
    if table is not None:
        parts.append(voltage_table(table, unit))
    elif shape.forward == "online":
        inverse = controller.feedforward
        assert inverse is not None
        coefficients = inverse._begun(controller.dt).coefficients()
        assert coefficients is not None
        settings = (float(controller.dt), float(inverse.offset), float(inverse.delay))
        parts.append(dahl_inverse(coefficients, *settings, unit, single=single))
    parts.append(loop(controller.limits, unit, shape))
    others = "".join(one.code for one in parts)
    return helpers(controller.limits, unit, others, single=single), *parts


def _laws(numbers: Numbers, unit: str) -> list[Part]:
    """Make the parts of the feedback law, the inner one first."""
    if "b" in numbers:
        return [state_space(numbers, unit)]
    inner, name = pid, "pid"
    if "sliding-mode" in numbers:
        inner, name = sliding_mode, "sliding"
    laws = [inner(numbers, unit)]
    if "disturbance-observer" in numbers:
        laws.append(disturbance_observer(numbers, unit, name))
    if "dahl-observer" in numbers:
        laws.append(dahl_observer(numbers, unit))
    if "damping" in numbers:
        laws.append(damping(numbers, unit))
    return laws
