"""Text of intervals of confidence."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ...._support.display.table import Column, Table
from ...._support.units import length_text

if TYPE_CHECKING:
    from ...fitted.certainty.confidence import Confidence, ParameterInterval

__all__ = ["confidence_text", "limits_text"]


def confidence_text(confidence: Confidence) -> str:
    """Write intervals as a table.

    Parameters
    ----------
    confidence : Confidence
        The intervals.

    Returns
    -------
    str
        Several lines.
    """
    draws = confidence.draws
    source = f"{draws} refits of resampled noise" if draws else "profiles of the cost"
    columns = [
        Column("parameter", left=True),
        Column("value", format=".5g"),
        Column("from"),
        Column("to"),
        Column("unit", left=True),
        *([] if draws else [Column("shape", left=True)]),
    ]
    rows = [
        (name, one.value, *limits_text(one), one.unit, *([] if draws else [one.shape]))
        for name, one in confidence.parameters.items()
    ]
    lines = [
        f"intervals of {100.0 * confidence.level:g} % from {source}, {confidence.samples} samples, "
        f"least cost {length_text(confidence.cost)} rms",
        *Table(columns, rows).lines(),
        *(f"note  {note}" for note in confidence.notes),
    ]
    if confidence.lower is not None:
        lower = confidence.lower
        values = ", ".join(f"{name} = {value:.5g}" for name, value in lower.values.items())
        lines.append(
            f"note  the fit is not the lowest minimum: {length_text(lower.fitted_cost)} rms, but "
            f"{length_text(lower.cost)} with {values}; the intervals are about that one: identify "
            "again with more runs"
        )
    return "\n".join(lines)


def limits_text(one: ParameterInterval) -> tuple[str, str]:
    """Write the ends of an interval.

    Parameters
    ----------
    one : ParameterInterval
        The interval.

    Returns
    -------
    (str, str)
        Numbers; "open" for an end that is not finite.
    """
    lower, upper = (f"{end:.5g}" if math.isfinite(end) else "open" for end in one.interval)
    return lower, upper
