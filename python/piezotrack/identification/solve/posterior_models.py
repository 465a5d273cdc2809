"""Models as likely as an identified one, given its record: the spread of an identification."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..._support.arguments import expect, positive
from ...data.dataset import Dataset
from ...errors import ParameterError, PiezotrackError
from ..fitted.identified_model import IdentifiedModel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["posterior_models"]

# Share of a value by which it is moved to see its effect.
STEP = 1e-4
# What a record does not determine moves by this share at most.
FURTHEST = 0.5
# Parts of the record whose deviations count as independent of each other.
PARTS = 40
# Halvings of a step that leaves the range of a parameter.
HALVINGS = 8


class _Value(NamedTuple):
    """A number of a model: the parameter, and which entry of a list."""

    name: str
    entry: int | None


def posterior_models(
    model: IdentifiedModel, data: Dataset, *, deviations: float = 2.0
) -> tuple[IdentifiedModel, ...]:
    r"""Move an identified model along the principal axes of its uncertainty.

    With the sensitivities :math:`J` of the displacement to the values that were fitted, and the
    deviations :math:`r` of the model from the record, the covariance of the values is

    .. math:: C = (J^T J)^{-1} \Big( \sum_b g_b g_b^T \Big) (J^T J)^{-1}, \qquad
              g_b = \sum_{t \in b} J_t^T r_t

    over parts :math:`b` of the record (White 1982, eq. 3.2, doi 10.2307/1912526), which holds for
    deviations that are correlated within a part too, as those of a model that is not exact are.
    Each axis gives two models, one in either direction. What the record does not determine moves by
    half of its value at most. ``pt.tune([fit, *posterior_models(fit, log)], ...)`` keeps its
    margins for all of them.

    Parameters
    ----------
    model : IdentifiedModel
        What was identified.
    data : Dataset
        The record, in the window that was fitted.
    deviations : float, optional
        How far to go along each axis, in standard deviations.

    Returns
    -------
    tuple of IdentifiedModel
        Two for each value that was fitted and is not 0; values on the edge of their range have one
        or none.

    Raises
    ------
    ParameterError
        `data` is no record or has too few samples, `deviations` is not above 0, or nothing was
        fitted.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.VirtualStage.of(
    ...     pt.stages.PrandtlIshlinskiiStage(linear=1e-6, thresholds=[10.0], weights=[0.3e-6]),
    ...     noise=20e-9,
    ... )
    >>> t = np.arange(0.0, 2.0, 1e-3)
    >>> log = stage.record(30.0 * (1.0 - np.cos(2.0 * np.pi * t)), 1e-3)
    >>> fit = pt.identify(log, "prandtl-ishlinskii")
    >>> nearby = pt.identification.posterior_models(fit, log)
    >>> all(one.score(log).rms < 1.1 * fit.score(log).rms for one in nearby)
    True
    """
    expect("model", model, IdentifiedModel, "a pt.IdentifiedModel")
    expect("data", data, Dataset, "a Dataset")
    positive("deviations", deviations, "")
    values = _fitted(model)
    if not values:
        raise ParameterError("model", "no values that were fitted", "an identified one", verb="has")
    if len(data.t) < 2 * PARTS:
        raise ParameterError("data", f"{len(data.t)} samples", f"{2 * PARTS} or more", verb="has")
    begins = _Beginning(model, data)
    columns = np.column_stack([begins.sensitivity(value) for value in values])
    axes = _axes(columns, begins.residual(model))
    models = []
    for axis in axes:
        for way in (deviations, -deviations):
            moved = _moved(model, values, way * axis)
            if moved is not None:
                models.append(moved)
    return tuple(models)


class _Beginning:
    """A record and the state in which it begins."""

    def __init__(self, model: IdentifiedModel, data: Dataset) -> None:
        self.model, self.data = model, data.without_far_readings()
        known = model.start_on(data)
        # A fitted voltage before the record stays what it is.
        fitted = known.history == "fit"
        self.how: dict[str, Any] = (
            {"initial": known.state} if fitted else {"history": known.history}
        )

    def residual(self, model: IdentifiedModel) -> Array:
        """Measured less simulated displacement, without offset and drift if fitted [m]."""
        run = model.simulate(self.data, offset=0.0, **self.how)
        rest = self.data.counted(self.data.y - run.x)
        if model.drift:
            return model.drift.left_of(self.data.counted(self.data.t), rest)
        return np.asarray(rest - rest.mean() if model.offset_fitted else rest)

    def sensitivity(self, value: _Value) -> Array:
        """Change of the displacement for a relative change of a value [m]."""
        for ways in ((STEP, -STEP), (STEP, 0.0), (0.0, -STEP)):
            models = [_with(self.model, [value], np.array([way])) for way in ways]
            if None not in models:
                up, down = (self.residual(one) for one in models if one is not None)
                return (down - up) / (ways[0] - ways[1])
        return np.zeros(self.data.counted(self.data.t).size)


def _fitted(model: IdentifiedModel) -> list[_Value]:
    """Name the values that were fitted and are not 0."""
    entries = model.document()["parameters"]
    fitted = []
    for name in model.model.parameter_names():
        value = getattr(model.model, name)
        if value is None or not entries.get(name, {}).get("free", False):
            continue
        if isinstance(value, tuple):
            fitted += [_Value(name, k) for k, one in enumerate(value) if one != 0.0]
        elif value != 0.0:
            fitted.append(_Value(name, None))
    return fitted


def _axes(columns: Array, residual: Array) -> list[Array]:
    """Principal axes of the covariance of relative changes, each one standard deviation long."""
    left, sizes, right = np.linalg.svd(columns, full_matrices=False)
    # Directions without effect go as far as is allowed.
    sizes = np.maximum(sizes, 1e-12 * max(sizes[0], 1e-300))
    parts = np.array_split(left * residual[:, None], PARTS)
    pulls = np.array([part.sum(axis=0) for part in parts]) / sizes
    lengths, turned = np.linalg.eigh(pulls.T @ pulls)
    spread = (turned * np.sqrt(np.maximum(lengths, 0.0))).T @ right
    return list(spread)


def _moved(model: IdentifiedModel, values: list[_Value], by: Array) -> IdentifiedModel | None:
    """Return the model with relative changes, shortened until they are in range."""
    by = by / max(1.0, float(np.abs(by).max()) / FURTHEST)
    for _ in range(HALVINGS):
        found = _with(model, values, by)
        if found is not None:
            return found
        by = 0.5 * by
    return None


def _with(model: IdentifiedModel, values: list[_Value], by: Array) -> IdentifiedModel | None:
    """Return the model with relative changes of values; None where one leaves its range."""
    changed: dict[str, Any] = {}
    for value, share in zip(values, by, strict=True):
        now = changed.get(value.name, getattr(model.model, value.name))
        if value.entry is None:
            changed[value.name] = now * (1.0 + share)
        else:
            entries = list(now)
            entries[value.entry] *= 1.0 + share
            changed[value.name] = tuple(entries)
    try:
        stage = replace(model.model, **changed)
    except PiezotrackError:
        return None
    return replace(_plain(model), model=stage)


def _plain(model: IdentifiedModel) -> IdentifiedModel:
    """Return an identified model without the search that found it."""
    given = {one.name: getattr(model, one.name) for one in fields(IdentifiedModel)}
    document = {} if type(model) is IdentifiedModel else model.document()
    return IdentifiedModel(**{**given, "details": given["details"] or document})
