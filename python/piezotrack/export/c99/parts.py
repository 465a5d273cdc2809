"""Which parts of a controller have a form in C, and in which order they come."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.arrays import signal_of
from ..._support.units import of_drive
from ...control.laws.neural_network import NetworkInverse
from ...control.loop.preconditions import check_period, check_turns, check_within_reach
from ...control.plant import plant_of_inverse
from ...errors import DataError, ParameterError, ShapeError
from .input import filters, numbers, readings
from .inverse import INVERSE_TERMS, dahl_inverse, square_root, voltage_table
from .laws import TERMS as OBSERVER_TERMS
from .laws import (
    Scale,
    dahl_observer,
    dahl_operator,
    damping,
    disturbance_observer,
    pid,
    sliding_mode,
    state_space,
)
from .loop import Shape, loop
from .repetitive import repetitive

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from ...control.controller.controller import Controller
    from ...references.reference import Reference
    from .text import Part

__all__ = ["coefficients_of", "feedforward_table", "gains_of", "parts_of", "shape_of"]

Numbers = dict[str, Any]
# The laws that have a form in C, unless what is inside of them has none.
WRITTEN = frozenset(
    (
        *("pid", "state-space", "lead-lag", "sliding-mode", "disturbance-observer"),
        *("perturbation-estimator", "hysteresis-observer", "integral-resonant"),
        *("positive-position", "positive-velocity-position"),
    )
)
# The coefficients of a law that has a form in C: of itself, or of the law inside.
FIRST = {"pid", "b", "sliding-mode"}
# The largest gain takes the command through its range for this error [m].
FINEST = 1e-9
# Longest table: its text has 50 bytes a sample.
MOST_SAMPLES = 1_000_000


def coefficients_of(controller: Controller) -> Numbers:
    """Return the numbers of every part as it is sampled, by name; of the filters a list."""
    numbers_of: Numbers = {"filters": []}
    for name, values in controller._core.coefficients():
        if name == "filter":
            numbers_of["filters"].append(values)
        else:
            numbers_of[name] = values
    return numbers_of


def feedforward_table(
    controller: Controller,
    reference: Reference | None,
    given: ArrayLike | None = None,
    *,
    beyond_reach: bool = False,
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
    beyond_reach : bool, optional
        Whether the reference may exceed the reach of the stage that the inverse inverts.

    Returns
    -------
    list of float or None
        Voltages at the samples of a period.

    Raises
    ------
    ParameterError
        The controller has no feedforward, the reference has no whole period, or not that of the
        repetitive part, or exceeds the reach of the stage; both are given.
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
    if not beyond_reach:
        plant, unit = plant_of_inverse(controller.feedforward), controller.drive_unit
        check_within_reach(plant, controller.limits, reference.sample(controller.dt), unit)
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
    forward = "given"
    if table is not None:
        forward = "table"
    elif controller.feedforward is not None:
        _check_online(controller)
        forward = "online"
    return Shape(
        law=_law_of(controller),
        repeats=learner is not None,
        pauses=learner is not None and learner.pause,
        filtered=bool(controller.filters),
        forward=forward,
    )


def _law_of(controller: Controller) -> str:
    """Kind of the law; empty without one."""
    law = controller.feedback
    if law is None:
        return ""
    # The core has no coefficients of what needs more than arithmetic.
    if law.info.name in WRITTEN and coefficients_of(controller).keys() & FIRST:
        return law.info.name
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
        stage = f"{inverse.stage.info.title} stage{' with creep' if creeps else ''}"
        what = f"the inverse of {'an' if stage[0] in 'aeiou' else 'a'} {stage}"
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
    """Make the parts of a controller in C.

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
    unit = _unit(controller)
    shape = shape_of(controller, table)
    parts = gains_of(controller)
    told = [name for one in parts for name in one.chooses if name.startswith("TOLD")]
    terms = (
        [OBSERVER_TERMS] if "LAW_DAHL" in {name for one in parts for name in one.chooses} else []
    )
    if table is not None:
        parts.append(voltage_table(table, unit))
    elif shape.forward == "online":
        inverse = controller.feedforward
        assert inverse is not None
        coefficients = inverse._begun(controller.dt).coefficients()
        assert coefficients is not None
        given = (float(controller.dt), float(inverse.offset), float(inverse.delay))
        terms.append(INVERSE_TERMS)
        parts += [square_root(), dahl_inverse(coefficients, *given, unit, single=single)]
    if terms:
        parts.append(dahl_operator(max(terms)))
    low, high = coefficients_of(controller)["span"]
    parts += [
        numbers(controller.limits, unit, single=single, repeats=shape.repeats),
        readings(low, high, controller.max_jump),
    ]
    additions = int("TOLD_APPLIED" in told) + int("TOLD_FEEDFORWARD" in told and shape.repeats)
    return *parts, loop(controller.limits, unit, shape, additions)


def _unit(controller: Controller) -> str:
    return "N" if controller.drive_unit == "N" else of_drive("V", controller.drive_unit)


def gains_of(controller: Controller) -> list[Part]:
    """Make the parts with numbers that are tuned: filters, feedback law, repetitive part.

    Parameters
    ----------
    controller : Controller
        The controller.

    Returns
    -------
    list of Part
        The parts, in the order of their numbers among the settings.

    Raises
    ------
    ParameterError
        The law has no form in C.
    """
    found, unit = coefficients_of(controller), _unit(controller)
    low, high = controller.limits
    scale = Scale(unit, (high - low) / FINEST, high - low)
    parts = [filters(found["filters"])] if found["filters"] else []
    if _law_of(controller):
        parts += _laws(found, scale, follows=controller.feedforward is not None)
    if controller.repetitive is not None:
        parts.append(repetitive(found, unit))
    return parts


def _laws(found: Numbers, scale: Scale, *, follows: bool) -> list[Part]:
    """Make the parts of the feedback law, the inner one first."""
    if "b" in found:
        return [state_space(found, scale)]
    laws = [(sliding_mode if "sliding-mode" in found else pid)(found, scale)]
    if "disturbance-observer" in found:
        laws.append(disturbance_observer(found, scale))
    if "dahl-observer" in found:
        laws.append(dahl_observer(found, scale))
    if "damping" in found:
        laws.append(damping(found, scale, follows=follows))
    return laws
