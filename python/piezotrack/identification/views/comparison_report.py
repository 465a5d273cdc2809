"""Table of a comparison of models, as text and as a notebook shows it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..._support.html_table import html_table

if TYPE_CHECKING:
    from ...data.dataset import Dataset
    from ..comparison.compare import Comparison, ModelScore

__all__ = ["comparison_html", "comparison_text"]

NOTES = """\
* best on the part not fitted, which is the figure to trust. fit %: 100 (1 - |error| / |y - mean|).
K: values fitted, - for a model that was given. dAIC, dBIC: above the lowest. Both assume
independent residuals; where r1, the correlation of neighbouring ones, is near 1, they favour too
many parameters (Burnham and Anderson 2002, doi 10.1007/b97636)."""


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
        drifts = any(row.fit.drift for row in comparison.rows)
        how = "another record, with an offset" + (" and a drift" if drifts else "") + " of its own"
    width = max(len(row.title) for row in rows)
    aic = min((row.aic for row in rows if row.aic is not None), default=0.0)
    bic = min((row.bic for row in rows if row.bic is not None), default=0.0)
    lines = [
        f"fitted on {_span(comparison.train)}",
        f"tested on {_span(comparison.test)}; {how}",
        f"per cent of the stroke fitted, {1e6 * comparison.train.stroke:.4g} um",
        "",
        f"  {'':<{width}}{'fitted':>12}{'not fitted':>20}",
        f"  {'model':<{width}}{'rms um':>9}{'rms %':>8}{'rms um':>10}{'rms %':>8}{'max um':>9}"
        f"{'fit %':>8}",
        *(f"{_mark(comparison, row)} {row.title:<{width}}{_errors(row)}" for row in rows),
        "",
        f"  {'':<{width}}{'K':>6}{'dAIC':>11}{'dBIC':>11}{'r1':>9}",
        *(f"  {row.title:<{width}}{_criteria(row, aic, bic)}" for row in rows),
    ]
    lines += ["", *(f"note  {note}" for note in comparison.notes)] if comparison.notes else []
    return "\n".join([*(line.rstrip() for line in lines), "", NOTES])


def comparison_html(comparison: Comparison) -> str:
    """Write the errors of each model; the best on what was not fitted in bold."""
    rows = [
        (
            row.title,
            *(
                cell
                for score in (row.train, row.test)
                for cell in (
                    f"{1e6 * score.rms:.4g}",
                    f"{score.rms_percent:.3g}",
                    f"{1e6 * score.max_error:.4g}",
                )
            ),
        )
        for row in comparison.rows
    ]
    heads = (
        "model",
        *(f"{part}: {what}" for part in ("fitted", "not fitted")
          for what in ("rms [um]", "rms [% of stroke]", "largest [um]")),
    )  # fmt: skip
    best = comparison.rows.index(comparison.best)
    return html_table("Comparison", rows, heads, bold=best)


def _mark(comparison: Comparison, row: ModelScore) -> str:
    return "*" if row is comparison.best else " "


def _errors(row: ModelScore) -> str:
    """Write the errors of one model on both parts."""
    fitted, test = row.train, row.test
    return (
        f"{1e6 * fitted.rms:>9.4g}{fitted.rms_percent:>8.3g}"
        f"{1e6 * test.rms:>10.4g}{test.rms_percent:>8.3g}{1e6 * test.max_error:>9.4g}"
        f"{test.fit_percent:>8.4g}"
    )


def _criteria(row: ModelScore, aic: float, bic: float) -> str:
    """Write the number of values fitted, and the criteria above their lowest."""
    if row.parameters is None or row.aic is None or row.bic is None:
        figures = f"{'-':>6}{'-':>11}{'-':>11}"
    else:
        figures = f"{row.parameters:>6}{_above(row.aic, aic):>11}{_above(row.bic, bic):>11}"
    return f"{figures}{row.autocorrelation:>9.3f}"


def _above(value: float, lowest: float) -> str:
    # Both are minus infinity where a fit is exact.
    above = 0.0 if value == lowest else value - lowest
    return f"{above:.0f}" if 1e4 <= above < 1e9 else f"{above:.4g}"


def _span(data: Dataset) -> str:
    source = f" of {data.source}" if data.source else ""
    return f"{data.t[0]:.6g} to {data.t[-1]:.6g} s{source}, {len(data)} samples"
