"""Identification of one kind of stage, or of the best one, from several records at once."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..._support.statistics import sample_noise
from ...errors import DataError, NumericalError
from ..fitted.start import GAIN
from ..fitted.trial import Trial
from .one_model import identify_weights
from .search import search_records
from .selection import (
    AS_NOISE,
    best_of,
    is_white,
    kinds_tried,
    refuse_of_one_model,
    short_trials,
    two_parts,
    with_trials,
)

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ...stages.model_info import ModelInfo
    from ..fitted.identification import Identification
    from ..problem.records import Asked

__all__ = ["best_together", "identify_together"]

# A history that a record shows and that nobody gave.
SHOWN = (("settled", None), ("fit", None))


def identify_together(
    records: Sequence[Asked],
    info: ModelInfo,
    of_search: Mapping[str, Any],
    least_squares: object = None,
) -> Identification:
    """Identify a stage of one kind from several records.

    Parameters
    ----------
    records : sequence of Asked
        The records, each with what is asked of it alone.
    info : ModelInfo
        The kind.
    of_search, least_squares : mapping, object
        Arguments for one of the two ways, not yet checked; those for the other are not used.

    Returns
    -------
    Identification
        The result.

    Raises
    ------
    ParameterError, DataError, NumericalError, Interrupted
        As for `identify`.
    """
    if not info.searched:
        return identify_weights(records, info, of_swarm=of_search, least_squares=least_squares)
    fit = search_records(records, info, **of_search)
    shown = [one if one.history else _with_shown(fit, one) for one in records]
    moved = [i for i, one in enumerate(shown) if (one.history, records[i].history) in SHOWN]
    if not moved:
        return fit
    other = search_records(shown, info, **of_search)
    if not other.cost < (1.0 - GAIN) * fit.cost:
        return fit
    # A model that takes one record for virgin shows more of the others than there is.
    for i in moved if len(moved) > 1 else []:
        simpler = [records[k] if k == i else one for k, one in enumerate(shown)]
        less = search_records(simpler, info, **of_search)
        if not other.cost < (1.0 - GAIN) * less.cost:
            shown, other = simpler, less
    return other


def _with_shown(fit: Identification, asked: Asked) -> Asked:
    """Give a record the history that it shows by the stage that never moved before any."""
    own = next(one for one in fit.records if one.data is asked.data)
    # As of another record: the one that was fitted begins as it was assumed to.
    model = replace(
        fit,
        records=(),
        start=None,
        delay=own.delay,
        offset_fitted=own.offset_fitted,
        drift=own.drift,
    )
    return replace(asked, history=model.start_on(asked.data).history)


def best_together(
    records: Sequence[Asked], of_search: Mapping[str, Any], least_squares: object = None
) -> Identification:
    """Identify the kind of stage that describes several records best.

    Parameters
    ----------
    records : sequence of Asked
        The records, each with what is asked of it alone.
    of_search, least_squares : mapping, object
        As for `identify_together`.

    Returns
    -------
    Identification
        The best of the kinds, fitted to the whole windows. The trials were fitted
        to the first part of each window and judged on the rest of each.

    Raises
    ------
    ParameterError, DataError, NumericalError, Interrupted
        As for `identify`.
    """
    refuse_of_one_model(of_search)
    trial, full = short_trials(of_search)
    pairs = [two_parts(one.data) for one in records]
    apart = all(part is not rest for part, rest in pairs)
    halves = zip(records, pairs, strict=True)
    first = [replace(one, data=part) for one, (part, _) in halves] if apart else records
    rests = [rest for _, rest in pairs] if apart else [one.data for one in records]
    counts = np.array([one.weight * len(rest) for one, rest in zip(records, rests, strict=True)])
    found: list[tuple[Trial, ModelInfo]] = []
    refused: Exception | None = None
    fit: Identification | None = None
    for info in kinds_tried(records[0].data, of_search):
        try:
            fit = identify_together(first, info, trial if apart else full, least_squares)
            left = [
                rest.y - fit.simulate(rest, offset=own.offset).x
                for rest, own in zip(rests, fit.records, strict=True)
            ]
        except (DataError, NumericalError) as error:
            refused = refused or error
            continue
        rms = np.array([math.sqrt(float(np.mean(one**2))) for one in left])
        whole = math.sqrt(float(counts @ rms**2) / float(counts.sum()))
        found.append((Trial(info.name, info.title, whole), info))
        noise = [sample_noise(rest.y) for rest in rests]
        if np.all(rms < AS_NOISE * np.array(noise)) and all(is_white(one) for one in left):
            break
    if not found or fit is None:
        raise refused or DataError("no kind of stage could be fitted")
    best, info = best_of(found)
    if apart or best is not found[-1][0]:
        fit = identify_together(records, info, full, least_squares)
    return with_trials(fit, found, float(first[0].data.t[-1]) if apart else None)
