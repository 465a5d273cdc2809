"""What is asked of a record: the searched parameters, their bounds, and what is known of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ... import _core
from ..._support.arguments import as_numbers, has_entries
from ..._support.messages import quoted
from ...data import diagnostics
from ...errors import ParameterError
from ..experiments.step_response import StepResult
from ..fitted.drift import drift_of_asked
from .parameters import ParameterArguments
from .records import of_record

if TYPE_CHECKING:
    from ...stages.model_info import ModelInfo
    from .records import Asked

__all__ = ["delay_bounds", "question_of"]


def question_of(
    asked: Asked,
    info: ModelInfo,
    *,
    free: object = None,
    fixed: object = None,
    initial: object = None,
    bounds: object = None,
    scales: object = None,
    ties: object = None,
    constraints: object = None,
    priors: object = None,
    stiffness: object = None,
    creep: object = None,
) -> dict[str, Any]:
    """Check what is asked of a record, and return it as the core takes it.

    Parameters
    ----------
    asked : Asked
        The record, and what is asked of it alone; without a history that of a stage that never
        moved.
    info : ModelInfo
        The model.
    free, fixed, initial, bounds, scales, ties, constraints, priors, stiffness, creep
        As for `identify`, not yet checked; None stands for the default.

    Returns
    -------
    dict
        In plain data.

    Raises
    ------
    ParameterError, DataError
        As for `identify`.
    """
    data = asked.data
    with of_record(asked.label):
        searched_delay = delay_bounds(asked.delay)
        drift = drift_of_asked(asked.drift, offset=asked.offset, searched=True)
    creep_times = _creep_times(False if creep is None else creep)
    said = ParameterArguments.checked(scales, ties, constraints, priors)
    held = _held(initial, fixed, free, bounds, said.named)
    with of_record(asked.label):
        diagnostics.check_record(data, searches_hysteresis=bool(set(info.hysteresis) - set(held)))
    full = data.full
    return {
        "model": info.name,
        "u": full.u,
        "y": full.y,
        "dt": data.dt,
        "hold_name": data.hold,
        "start": data.warmup,
        "free": _names(free),
        "fixed": list(held.items()),
        "bounds": [(name, _pair(name, pair)) for name, pair in _items("bounds", bounds)],
        **said.core,
        "stiffness": None if stiffness is None else _core.as_number("stiffness", stiffness),
        "offset": asked.offset,
        "delay": searched_delay,
        "drift": drift,
        "history": asked.history or "virgin",
        "creep": creep_times,
        "label": asked.label,
        "weight": asked.weight,
    }


def _names(free: object) -> list[str] | None:
    """Check that free names parameters in a list."""
    if free is None:
        return None
    if not has_entries(free):
        raise ParameterError(f"free is {quoted(free)}: expected names in a list, as ['mass']")
    return [str(name) for name in free]


def _held(
    initial: object, fixed: object, free: object, bounds: object, named: set[str]
) -> dict[str, float]:
    """Return the parameters held: by `fixed`, and by a step response where not named elsewhere."""
    given = {name: _core.as_number(name, value) for name, value in _items("fixed", fixed)}
    if initial is None:
        return given
    if not isinstance(initial, StepResult):
        raise ParameterError(
            f"initial is {type(initial).__name__}: expected a StepResult, see pt.identify_step"
        )
    said = named | {*(_names(free) or []), *(name for name, _ in _items("bounds", bounds))}
    return {n: v for n, v in initial.hysteresis.items() if n not in said} | given


def _items(argument: str, mapping: object) -> list[tuple[str, Any]]:
    """Check that an argument is a mapping, and return its entries."""
    if mapping is None:
        return []
    if not isinstance(mapping, Mapping):
        raise ParameterError(
            f"{argument} is {quoted(mapping)}: expected a mapping of names to values"
        )
    return [(str(name), value) for name, value in mapping.items()]


def _pair(name: str, pair: object) -> tuple[float, float]:
    """Check that bounds are two numbers."""
    two = list(pair) if has_entries(pair) else []
    if len(two) != 2:
        raise ParameterError(f"bounds of {name} are {quoted(pair)}: expected (low, high)")
    low, high = two
    return (
        _core.as_number(f"lower bound of {name}", low),
        _core.as_number(f"upper bound of {name}", high),
    )


def delay_bounds(delay: object) -> tuple[float, float] | None:
    """Bounds between which a delay is searched.

    Parameters
    ----------
    delay : object
        As for `identify`, not yet checked.

    Returns
    -------
    (float, float) or None
        The bounds [s], equal ones where it is known; None where the core chooses them.

    Raises
    ------
    ParameterError
        It is none of what `identify` takes.
    """
    if delay is None or isinstance(delay, bool):
        return None if delay else (0.0, 0.0)
    if has_entries(delay):
        low, high = _pair("delay", delay)
        if low >= high:
            raise ParameterError(
                f"bounds of delay are ({low:g}, {high:g}) s: expected the lower one first"
            )
        return low, high
    known = _core.as_number("delay", delay)
    return known, known


def _creep_times(creep: object) -> list[float] | None:
    """Time constants of the creep: None if the core chooses them, empty if there is none."""
    if isinstance(creep, bool):
        return None if creep else []
    if not has_entries(creep):
        raise ParameterError(
            f"creep is {quoted(creep)}: expected True, False or time constants in seconds, "
            "as [0.1, 1.0]"
        )
    return list(as_numbers("creep", creep))
