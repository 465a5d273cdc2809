"""The score of a fit on a record that it was not fitted to, kept with its model."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ...data.dataset import Dataset
    from ..fitted.identification import Identification
    from ..fitted.score import Score

__all__ = ["validated"]


def validated(fit: Identification, data: Dataset) -> tuple[Identification, Score]:
    """Score a fit on a second record; the result goes into the file of the model.

    Parameters
    ----------
    fit : Identification
        The fit.
    data : Dataset
        The second record.

    Returns
    -------
    fit : Identification
        The same, with the score in its details.
    score : Score
        The score, as of `IdentifiedModel.score`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> log = pt.datasets.dbo_training()
    >>> fit = pt.identify(log[:11.0], "prandtl-ishlinskii")
    >>> fit, score = pt.identification.validated(fit, log[11.0:])
    >>> fit.details["validation"]["rms"]["value"] == score.rms
    True
    """
    score = fit.score(data)
    validation = {
        "source": data.source,
        "sha256": data.sha256,
        "window_s": [float(data.t[0]), float(data.t[-1])],
        "rms": {"value": score.rms, "unit": "m"},
        "max_error": {"value": score.max_error, "unit": "m"},
        "max_error_time": {"value": score.max_error_time, "unit": "s"},
        "fitted_share": score.fitted_share,
        "fit_percent": {"value": score.fit_percent, "unit": "%"},
        "offset": {"value": score.offset, "unit": "m"},
    }
    return replace(fit, details={**fit.details, "validation": validation}), score
