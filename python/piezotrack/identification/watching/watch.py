"""`watch`: whether a stage is still that of its model."""

from __future__ import annotations

import numpy as np

from ..._support.arguments import expect
from ..._support.units import shown_unit
from ...data.dataset import Dataset
from ...errors import DataError, ParameterError, ShapeError
from ..fitted.identified_model import IdentifiedModel
from .health import Health
from .judgement import Judgement
from .known import Known
from .refit import refitted

__all__ = ["watch"]

# Samples of a record at least.
LEAST = 100
# Part of the range identified by which the drive may go beyond it.
BEYOND = 0.05


def watch(model: IdentifiedModel, record: Dataset, *, refit: bool = False) -> Health:
    r"""Judge from a new record whether a stage is still that of its model.

    Changes of gain, hysteresis, mode, lag, delay and drift are fitted to the residual of the
    record, by Gauss-Newton steps of the model. Their standard deviations are those of least squares
    with a correlated residual, by its autoregression (Domowitz and White 1982, doi
    10.1016/0304-4076(82)90012-3), enlarged by what the covariance of the model makes of each.
    The model itself is inexact: of its own residual what is not noise,
    :math:`\sqrt{e^2 - \sigma^2}`, may be a change wholly, so each interval is wider by that over
    the rms of what the change moves and nothing else does. The intervals hold at once, by
    Bonferroni's inequality.

    The gain is that of all of the motion, and the delay all that it comes later: of mode and lag
    what is not one of the two.

    Parameters
    ----------
    model : IdentifiedModel
        A fit, or a model of `load`.
    record : Dataset
        Another record of the stage, at most 5 % beyond the range of the drive identified and twice
        as fast.
    refit : bool, optional
        Whether the model is identified again, from the record without its last third, on which it
        is accepted or not: `Health.refit`.

    Returns
    -------
    Health
        A verdict on each change, with its interval.

    Raises
    ------
    ParameterError
        The arguments are of other kinds, the record is in another unit of the drive, or beyond what
        was identified, or the model has no residual of a record.
    ShapeError, DataError
        The record is too short, or its drive is constant.
    NumericalError
        The model cannot be simulated on it.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6]
    ... )
    >>> t = np.arange(2000) * 0.005
    >>> u = 40.0 - 30.0 * np.cos(3.0 * t) + 10.0 * np.sin(7.0 * t)
    >>> noise = 2e-8 * np.random.default_rng(1).standard_normal((2, u.size))
    >>> model = pt.identify(
    ...     pt.Dataset(u=u, y=stage.simulate(u, 0.005).x + noise[0], dt=0.005),
    ...     "prandtl-ishlinskii",
    ... )
    >>> later = 1.02 * stage.simulate(0.9 * u, 0.005).x + noise[1]
    >>> health = pt.watch(model, pt.Dataset(u=0.9 * u, y=later, dt=0.005))
    >>> print(health.healthy, f"{100 * health['gain'].value:+.1f} %", health["gain"].verdict)
    False +2.0 % changed
    """
    expect("model", model, IdentifiedModel, "a model, as of pt.load")
    expect("record", record, Dataset, "a Dataset")
    known = Known.of(model)
    _check(model, record, known)
    judgement = Judgement(model, record.without_faulty_readings(), known)
    changes = judgement.changes()
    return Health(
        model=model.model.info.title,
        source=record.source,
        rms=judgement.rms,
        rms_identified=known.rms,
        effective=judgement.before.effective,
        changes=changes,
        refit=refitted(model, record, judgement.motion.start, changes) if refit else None,
        provenance={
            "data": {"source": record.source, "sha256": record.sha256},
            "identified": {key: model._record.get(key) for key in ("source", "sha256")},
        },
    )


def _check(model: IdentifiedModel, record: Dataset, known: Known) -> None:
    """Refuse a record on which the model says nothing."""
    unit = model.drive_unit
    if record.drive_unit != unit:
        raise ParameterError(
            "record",
            f"driven in {shown_unit(record.drive_unit)[0]}",
            f"a drive in {shown_unit(unit)[0]}, as that of the model",
        )
    if len(record) < LEAST:
        raise ShapeError("record", f"{len(record)} samples", f"{LEAST} or more")
    if not np.ptp(record.u):
        raise DataError(
            f"record: the drive stays at {record.u[0]:g} {unit}: expected one that moves the stage"
        )
    drive, (low, high) = record.full.u, known.drive_range
    margin = BEYOND * (high - low)
    if low - margin <= drive.min() and drive.max() <= high + margin:
        drive = np.clip(drive, low, high)
    for note in model.extrapolation_notes(drive, record.dt):
        raise ParameterError(
            "record", f"beyond what was identified ({note})", "a drive within it", verb="goes"
        )
