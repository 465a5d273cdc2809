"""Identify a model again from a new record, and judge it where it was not fitted."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import stdtrit

from ..fit import identify
from .correlated import Autoregression
from .health import Refit

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ...stages.motion import StageState
    from ..fitted.identified_model import IdentifiedModel
    from ..fitted.start import Start
    from .health import Change

    Array = NDArray[np.float64]

__all__ = ["refitted"]

# Part of the record that is fitted first.
FITTED = 2.0 / 3.0


def refitted(
    model: IdentifiedModel, record: Dataset, start: Start, changes: Iterable[Change]
) -> Refit:
    """Identify a model again, and accept it where the rest of the record shows it to be better.

    Parameters
    ----------
    model : IdentifiedModel
        The old model; of the new one family, offset, delay, creep and what was held are the same.
    record : Dataset
        The record.
    start : Start
        Where it begins, of the old model.
    changes : iterable of Change
        Verdicts on the old model, for the new file.

    Returns
    -------
    Refit
        The decision. An accepted model is the one that was judged, of the first two thirds.
    """
    split = float(record.t[0] + FITTED * (record.t[-1] - record.t[0]))
    arguments, name = _arguments(model), model.model.info.name
    held = record[split:].without_faulty_readings()
    fresh = identify(record[:split], name, **arguments)
    states = (start.state, fresh.start_on(record).state)
    pairs = zip((model, fresh), states, strict=True)
    errors = [_error(one, held, state) for one, state in pairs]
    gained = errors[0] ** 2 - errors[1] ** 2
    process, scale = Autoregression(gained, 0), float(np.mean(errors[0] ** 2)) or 1.0
    width = float(stdtrit(max(process.effective, 2.0), 0.975)) * process.of_mean
    mean = float(gained.mean())
    refit = Refit(
        accepted=mean - width > 0.0,
        held_out=(float(held.t[0]), float(held.t[-1])),
        rms_before=float(np.sqrt(np.mean(errors[0] ** 2))),
        rms_after=float(np.sqrt(np.mean(errors[1] ** 2))),
        improvement=mean / scale,
        interval=((mean - width) / scale, (mean + width) / scale),
    )
    if not refit.accepted:
        return refit
    before = {key: model._record.get(key) for key in ("source", "sha256")}
    noted = [one._asdict() for one in changes]
    watched = {"replaces": before, **refit.entry, "changes": noted}
    details = {**fresh.details, "provenance": {**fresh.details["provenance"], "watch": watched}}
    return refit._replace(model=replace(fresh, details=details))


def _error(model: IdentifiedModel, held: Dataset, state: StageState) -> Array:
    """Deviation on the part that was held out, with an offset of its own there [m]."""
    x = model.simulate(held, offset=0.0, initial=state).x
    rest = held.counted(held.y - x)
    return rest - rest.mean() if model.offset_fitted else rest - model.offset


def _arguments(model: IdentifiedModel) -> dict[str, Any]:
    """Arguments of the identification that are those of the old model."""
    entries = model.details.get("parameters") or {}
    late = model.details.get("delay") or {}
    arguments: dict[str, Any] = {
        "offset": model.offset_fitted,
        "delay": True if late.get("free") else model.delay or None,
        "progress": False,
    }
    if not model.model.info.searched:
        return arguments
    nominal = {"stiffness"} if model.scale_assumed else set()
    held = {
        one.name: entry.get("tie") or getattr(model.model, one.name)
        for one in model.model.info.parameters
        if not one.is_list
        and one.name not in nominal
        and not (entry := entries.get(one.name, {"free": True})).get("free", True)
    }
    creep = model.model.creep_times
    return {**arguments, "parameters": held or None, "creep": creep or None}
