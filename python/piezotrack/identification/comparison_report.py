"""The table of a comparison of models."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..data.dataset import Dataset
    from .comparison import Comparison, ModelScore

__all__ = ["comparison_text"]

NOTES = """\
* lowest rms on the part not fitted, which is the criterion to use. K: number of values fitted,
- for a model that was given. dAIC, dBIC: difference from the lowest of n ln(RSS/n) + 2 (K + 1) and
of n ln(RSS/n) + (K + 1) ln n. Both assume independent residuals; r1 is the correlation of
neighbouring ones. Where it is near 1 both favour too many parameters (Burnham and Anderson 2002,
doi 10.1007/b97636)."""


def comparison_text(comparison: Comparison) -> str:
    """Write a comparison as a table.

    Parameters
    ----------
    comparison : Comparison
        The models, compared.

    Returns
    -------
    str
        Several lines.
    """
    rows, how = comparison.rows, "state and offset carried over"
    if not comparison.carried:
        how = "another record, with an offset of its own"
    width = max(len(row.title) for row in rows)
    aic = min((row.aic for row in rows if row.aic is not None), default=0.0)
    bic = min((row.bic for row in rows if row.bic is not None), default=0.0)
    one = f"{'rms um':>9}{'rms %':>8}{'max um':>9}"
    lines = [
        f"fitted on {_span(comparison.train)}",
        f"tested on {_span(comparison.test)}; {how}",
        f"per cent of the stroke fitted, {1e6 * comparison.train.stroke:.4g} um",
        "",
        f"  {'':<{width}}  {'fitted':^26}  {'not fitted':^26}",
        f"  {'model':<{width}}  {one}  {one}  {'K':>4}{'dAIC':>9}{'dBIC':>9}{'r1':>7}",
    ]
    for row in rows:
        mark = "*" if row is comparison.best else " "
        lines.append(f"{mark} {row.title:<{width}}  {_figures(row, aic, bic)}")
    lines += ["", *(f"note  {note}" for note in comparison.notes)] if comparison.notes else []
    return "\n".join([*(line.rstrip() for line in lines), "", NOTES])


def _figures(row: ModelScore, aic: float, bic: float) -> str:
    """Write the figures of one model; the criteria above their lowest."""
    scores = "  ".join(
        f"{1e6 * score.rms:>9.4g}{score.rms_percent:>8.3g}{1e6 * score.max_error:>9.4g}"
        for score in (row.train, row.test)
    )
    if row.parameters is None or row.aic is None or row.bic is None:
        criteria = f"{'-':>4}{'-':>9}{'-':>9}"
    else:
        above = (_above(row.aic, aic), _above(row.bic, bic))
        criteria = f"{row.parameters:>4}{above[0]:>9}{above[1]:>9}"
    return f"{scores}  {criteria}{row.autocorrelation:>7.3f}"


def _above(value: float, lowest: float) -> str:
    # Both are minus infinity where a fit is exact.
    return "0" if value == lowest else f"{value - lowest:.4g}"


def _span(data: Dataset) -> str:
    source = f" of {data.source}" if data.source else ""
    return f"{data.t[0]:.6g} to {data.t[-1]:.6g} s{source}, {len(data)} samples"
