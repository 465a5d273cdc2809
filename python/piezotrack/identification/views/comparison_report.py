"""Table of a comparison of models, as text and as a notebook shows it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..._support.display.table import Column, Table

if TYPE_CHECKING:
    from ...data.dataset import Dataset
    from ..comparison.compare import Comparison, ModelScore

__all__ = ["comparison_html", "comparison_text"]

NOTES = """\
* best on the part not fitted, which is the figure to trust. fit %: 100 (1 - |error| / |y - mean|).
K: values fitted, - for a model that was given. dAIC, dBIC: above the lowest. Both assume
independent residuals; where r1, the correlation of neighbouring ones, is near 1, they favour too
many parameters (Burnham and Anderson 2002, doi 10.1007/b97636)."""
ERRORS = (
    Column("rms", "um", ".4g", 9, 0),
    Column("rms", "%", ".3g", 8, 0),
    Column("rms", "um", ".4g", 10, 0),
    Column("rms", "%", ".3g", 8, 0),
    Column("max", "um", ".4g", 9, 0),
    Column("fit", "%", ".4g", 8, 0),
)
CRITERIA = (
    Column("K", width=6, before=0),
    Column("dAIC", width=11, before=0),
    Column("dBIC", width=11, before=0),
    Column("r1", "", ".3f", 9, 0),
)


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
        *Table(
            (Column(width=1, before=0), Column("model", width=width, before=1, left=True), *ERRORS),
            [(_mark(comparison, row), row.title, *_errors(row)) for row in rows],
        ).lines(),
        "",
        *Table(
            (Column(width=width, left=True), *CRITERIA),
            [(row.title, *_criteria(row, aic, bic)) for row in rows],
        ).lines(),
    ]
    lines += ["", *(f"note  {note}" for note in comparison.notes)] if comparison.notes else []
    return "\n".join([*lines, "", NOTES])


def comparison_html(comparison: Comparison) -> str:
    """Write the errors of each model; the best on what was not fitted in bold."""
    rows = [
        (row.title, *(value for score in (row.train, row.test) for value in
                      (1e6 * score.rms, score.rms_percent, 1e6 * score.max_error)))
        for row in comparison.rows
    ]  # fmt: skip
    errors = (("rms", "um", ".4g"), ("rms", "% of stroke", ".3g"), ("largest", "um", ".4g"))
    columns = [Column(f"{part}: {name}", unit, form)
               for part in ("fitted", "not fitted") for name, unit, form in errors]  # fmt: skip
    best = comparison.rows.index(comparison.best)
    return Table([Column("model"), *columns], rows, "Comparison").html(bold=best)


def _mark(comparison: Comparison, row: ModelScore) -> str:
    return "*" if row is comparison.best else " "


def _errors(row: ModelScore) -> tuple[float, ...]:
    """Return the errors of one model on both parts, for `ERRORS`."""
    fitted, test = row.train, row.test
    return (
        1e6 * fitted.rms,
        fitted.rms_percent,
        1e6 * test.rms,
        test.rms_percent,
        1e6 * test.max_error,
        test.fit_percent,
    )


def _criteria(row: ModelScore, aic: float, bic: float) -> tuple[object, ...]:
    """Return the number of values fitted, and the criteria above their lowest."""
    if row.parameters is None or row.aic is None or row.bic is None:
        return None, None, None, row.autocorrelation
    return row.parameters, _above(row.aic, aic), _above(row.bic, bic), row.autocorrelation


def _above(value: float, lowest: float) -> str:
    # Both are minus infinity where a fit is exact.
    above = 0.0 if value == lowest else value - lowest
    return f"{above:.0f}" if 1e4 <= above < 1e9 else f"{above:.4g}"


def _span(data: Dataset) -> str:
    source = f" of {data.source}" if data.source else ""
    return f"{data.t[0]:.6g} to {data.t[-1]:.6g} s{source}, {len(data)} samples"
