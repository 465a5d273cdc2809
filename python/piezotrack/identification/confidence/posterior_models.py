"""Models as likely as an identified one, given its record: the spread of an identification."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.arguments import expect, positive
from ...data.dataset import Dataset
from ...errors import ParameterError
from ..fitted.identified_model import IdentifiedModel
from ..linearised.values import fitted_values, moved, sizes_of
from .estimate import covariance_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..fitted.certainty.covariance import Covariance
    from ..linearised.values import Value

    Array = NDArray[np.float64]

__all__ = ["posterior_models"]

# What a record does not determine moves by this share at most.
FURTHEST = 0.5
# Fewest samples of a record.
FEWEST = 80
# Halvings of a step that leaves the range of a parameter.
HALVINGS = 8


def posterior_models(
    model: IdentifiedModel, data: Dataset, *, deviations: float = 2.0
) -> tuple[IdentifiedModel, ...]:
    r"""Move an identified model along the principal axes of its uncertainty.

    The covariance is that of `Identification.covariance`, for deviations that are correlated, as
    those of a model that is not exact are; what repeats from period to period, the error of the
    model, counts too.

    Each axis gives two models, one in either direction. What the record does not determine moves by
    half of its value at most. ``pt.tune([fit, *posterior_models(fit, log)], ...)`` keeps its
    margins for all of them, and makes the error of the worst small.

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
    if not (values := fitted_values(model)):
        raise ParameterError("model", "no values that were fitted", "an identified one", verb="has")
    if len(data.t) < FEWEST:
        raise ParameterError("data", f"{len(data.t)} samples", f"{FEWEST} or more", verb="has")
    covariance = covariance_of(model, [(data, 1.0)], noise="residual")
    sizes = sizes_of(model, values, data.dt)
    axes = _axes(covariance, sizes)
    models = []
    for axis in axes:
        for way in (deviations, -deviations):
            nearby = _moved(model, values, way * axis, sizes)
            if nearby is not None:
                models.append(nearby)
    return tuple(models)


def _axes(covariance: Covariance, sizes: Array) -> list[Array]:
    """Principal axes of relative changes, each one standard deviation long."""
    lengths, turned = np.linalg.eigh(covariance.matrix / np.outer(sizes, sizes))
    axes = list((turned * np.sqrt(np.maximum(lengths, 0.0))).T)
    # Values without effect go as far as is allowed.
    hidden = np.flatnonzero(~covariance.determined)
    return axes + [FURTHEST * np.eye(sizes.size)[place] for place in hidden]


def _moved(
    model: IdentifiedModel, values: list[Value], by: Array, sizes: Array
) -> IdentifiedModel | None:
    """Return the model with relative changes, shortened until they are in range."""
    by = by / max(1.0, float(np.abs(by).max()) / FURTHEST)
    for _ in range(HALVINGS):
        nearby = moved(model, values, by * sizes)
        if nearby is not None:
            return nearby
        by = 0.5 * by
    return None
