"""Text of a prediction with its band."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...._support.units import length_text

if TYPE_CHECKING:
    from ...fitted.certainty.prediction_band import PredictionBand

__all__ = ["band_notes", "band_text"]


def band_text(band: PredictionBand) -> str:
    """Write a prediction and its band.

    Parameters
    ----------
    band : PredictionBand
        The prediction.

    Returns
    -------
    str
        Several lines.
    """
    rows = [
        ("noise", band.noise),
        ("parameters", band.parameters),
        ("model error", band.model_error),
        ("band", band.half),
    ]
    lines = [
        f"displacement under {band.u.size} samples, {length_text(float(np.ptp(band.x)))} of travel",
        f"half width of the {100.0 * band.level:g} % band, for cycles as those of the records:",
        *(
            f"  {name:<12} {length_text(float(np.median(size)), 3)}, "
            f"{length_text(float(size.max()), 3)} at most"
            for name, size in rows
        ),
    ]
    if band.coverage is not None:
        lines.append(f"{100.0 * band.coverage:.3g} % of the readings are in the band")
    return "\n".join([*lines, *(f"note  {one}" for one in band_notes(band))])


def band_notes(band: PredictionBand) -> list[str]:
    """Write what limits a band.

    Parameters
    ----------
    band : PredictionBand
        The prediction.

    Returns
    -------
    list of str
        One sentence each.
    """
    notes = []
    if band.cycles < 2:
        notes.append("the records have no two cycles: the errors are those of the fit itself")
    if (share := float(np.mean(band.unlike))) > 0.0:
        notes.append(
            f"{100.0 * share:.2g} % of the drive has an amplitude or a rate that the records do "
            "not have: the band is a guess there"
        )
    return notes
