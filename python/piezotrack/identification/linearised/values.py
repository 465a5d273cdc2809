"""The numbers of an identified model that were fitted, and models in which they are changed."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ... import _core
from ...errors import ParameterError, PiezotrackError
from ..fitted.identified_model import IdentifiedModel

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = [
    "DELAY",
    "Value",
    "entries_of",
    "fitted_values",
    "free_values",
    "moved",
    "sizes_of",
    "without_search",
]

DELAY = "delay"


class Value(NamedTuple):
    """A number that was fitted.

    Attributes
    ----------
    parameter : str
        The parameter of the stage, or ``"delay"``.
    entry : int or None
        Which entry of a list.
    """

    parameter: str
    entry: int | None = None

    def __str__(self) -> str:
        return self.parameter if self.entry is None else f"{self.parameter}[{self.entry}]"

    @classmethod
    def named(cls, name: str) -> Value:
        """Return the number that is written as ``"weights[2]"``."""
        parameter, _, entry = name.removesuffix("]").partition("[")
        return cls(parameter, int(entry) if entry else None)

    def of(self, model: IdentifiedModel) -> float:
        """Return the number in a model, SI."""
        if self.parameter == DELAY:
            return model.delay
        value = getattr(model.model, self.parameter)
        return float(value if self.entry is None else value[self.entry])

    def size_in(self, model: IdentifiedModel) -> float:
        """Size in a model, SI; of an entry that is 0 the mean of those of its list, or 1."""
        size = abs(self.of(model))
        if size == 0.0 and self.entry is not None:
            size = float(np.mean(np.abs(getattr(model.model, self.parameter)))) or 1.0
        return size


def fitted_values(model: IdentifiedModel) -> list[Value]:
    """List the numbers that were fitted and are not 0, on a bound or on a constraint.

    Parameters
    ----------
    model : IdentifiedModel
        The model.

    Returns
    -------
    list of Value
        Entries of lists one by one; the delay of one record last. Where the covariance is known,
        those that it has.
    """
    if model.covariance is not None:
        return [Value.named(name) for name in model.covariance.names]
    entries = entries_of(model)
    free = {name for name, entry in entries.items() if entry.get("free", False)}
    bounded = {name for name in free if entries[name].get("at_bound", False)}
    values = free_values(model.model, free - bounded)
    if len(model.records) <= 1 and model.details.get(DELAY, {}).get("free", False):
        values.append(Value(DELAY))
    return values


def free_values(stage: Any, free: Collection[str]) -> list[Value]:
    """List the numbers of some parameters of a stage that are not 0.

    Parameters
    ----------
    stage : Stage
        The stage.
    free : collection of str
        The parameters.

    Returns
    -------
    list of Value
        Entries of lists one by one.
    """
    values: list[Value] = []
    for name in stage.parameter_names():
        value = getattr(stage, name)
        if name not in free or value is None:
            continue
        if isinstance(value, tuple):
            values += [Value(name, k) for k, number in enumerate(value) if number != 0.0]
        elif value != 0.0:
            values.append(Value(name))
    return values


def sizes_of(model: IdentifiedModel, values: list[Value], dt: float) -> Array:
    """Return the sizes of values, to count changes in shares of them.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    values : list of Value
        Its values.
    dt : float
        Size of a delay of 0 [s].

    Returns
    -------
    ndarray, shape (p,)
        SI, above 0.
    """
    return np.array([value.size_in(model) or dt for value in values], dtype=np.float64)


def entries_of(model: IdentifiedModel) -> Mapping[str, Any]:
    """Return what the identification said of each parameter, by its name."""
    entries: Mapping[str, Any] = model.details.get("parameters", {})
    return entries


def moved(model: IdentifiedModel, values: list[Value], changes: Array) -> IdentifiedModel | None:
    """Return a model some of whose values are changed, with those that are tied to them.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    values : list of Value
        What is changed.
    changes : ndarray, shape (p,)
        By how much, SI.

    Returns
    -------
    IdentifiedModel or None
        None where a value leaves the range in which there is such a stage.
    """
    changed: dict[str, Any] = {}
    delay = model.delay
    for value, change in zip(values, changes, strict=True):
        if value.parameter == DELAY:
            delay += change
            continue
        now = changed.get(value.parameter, getattr(model.model, value.parameter))
        if value.entry is None:
            changed[value.parameter] = now + change
        else:
            numbers = list(now)
            numbers[value.entry] += change
            changed[value.parameter] = tuple(numbers)
    try:
        changed |= _tied(model, changed) | _normalised(model, changed)
        stage = replace(model.model, **changed)
    except PiezotrackError:
        return None
    return replace(without_search(model), model=stage, delay=delay)


def _tied(model: IdentifiedModel, changed: Mapping[str, Any]) -> dict[str, float]:
    """Values of the parameters that are tied to others."""
    entries = entries_of(model)
    if not any("tie" in entry for entry in entries.values()):
        return {}
    scalars = [one.name for one in model.model.info.parameters if not one.is_list]
    ties = [(k, entries[n]["tie"]) for k, n in enumerate(scalars) if "tie" in entries.get(n, {})]
    values = [changed.get(name, getattr(model.model, name)) for name in scalars]
    known = [0.0 if value is None else float(value) for value in values]
    tied = _core.tied_values(model.model.info.name, known, ties)
    return {scalars[place]: tied[place] for place, _ in ties}


def _normalised(model: IdentifiedModel, changed: Mapping[str, Any]) -> dict[str, Any]:
    """Values that follow from others in a fit by least squares."""
    stage = model.model
    if stage.info.searched or not changed:
        return {}
    now = {name: changed.get(name, getattr(stage, name)) for name in stage.parameter_names()}
    if "slip_displacements" in now:
        # The thresholds stay where they are.
        known = (stage.piezo_coefficient, stage.stiffness_ratios)
        drive = _slips(*known, stage.slip_displacements, inverse=True)
        slips = _slips(now["piezo_coefficient"], now["stiffness_ratios"], drive)
        return {"slip_displacements": slips}
    if now.get("scale") is None or stage.falling_scale is not None or model.drive_range is None:
        return {}
    # The envelope is 0 at 0 V and rises by as much as the drive.
    ends = np.array(model.drive_range)
    rise = float(np.diff(np.tanh(stage.slope * ends + stage.shift))[0]) * stage.scale
    steep = float(np.diff(np.tanh(now["slope"] * ends + now["shift"]))[0])
    if steep == 0.0:
        raise ParameterError("slope", now["slope"], "one with which the envelope rises")
    scale = rise / steep
    middle = stage.level + stage.scale * np.tanh(stage.shift)
    return {"scale": scale, "level": float(middle - scale * np.tanh(now["shift"]))}


def _slips(
    gain: float, ratios: Sequence[float], at: Sequence[float], *, inverse: bool = False
) -> tuple[float, ...]:
    """Displacements at which elements slip [m], of thresholds of the drive [V]; or the inverse."""
    stiffness = 1.0 + np.append(np.cumsum(ratios[::-1])[::-1], 0.0)[: len(at)]
    slopes = abs(gain) / stiffness
    steps = np.diff(np.array(at), prepend=0.0)
    return tuple(np.cumsum(steps / slopes if inverse else steps * slopes).tolist())


def without_search(model: IdentifiedModel) -> IdentifiedModel:
    """Return an identified model without the search that found it."""
    return IdentifiedModel(
        **{field.name: getattr(model, field.name) for field in fields(IdentifiedModel)}
    )
