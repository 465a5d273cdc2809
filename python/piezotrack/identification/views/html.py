"""A fit as tables, as a notebook shows it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ..._support.display.table import words
from .confidence.residual_report import fit_notes
from .quantities import errors_of, of_sensor, of_stage, predicted
from .report import parameter_notes

if TYPE_CHECKING:
    from ..._support.display.table import Table
    from ...data.dataset import Dataset
    from ..fitted.estimates import Constraint, Estimate
    from ..fitted.identification import Identification

__all__ = ["identification_html", "records_table"]


def identification_html(fit: Identification) -> str:
    """Write model, record, errors, parameters and warnings of a fit."""
    rows = [
        *(_record(one.data) for one in fit.records if one.data is not None),
        ("model", repr(fit.model)),
        *of_stage(fit),
    ]
    if len(fit.records) == 1:
        rows += [*of_sensor(fit.records[0], fit.data), *errors_of(fit, 0)]
    else:
        rows.append(("rms error", f"{fit.cost_um:.4g} um, {fit.cost_percent:.3g} % of stroke"))
    rows += predicted(fit)
    rows += [("constraint", _constraint(one)) for one in fit.constraints]
    rows += [("note", note) for note in fit_notes(fit)]
    tables = [words(f"Identification: {fit.model.info.title}", rows).html()]
    if len(fit.records) > 1:
        tables.append(records_table(fit).html())
    if fit.parameters:
        found = [_estimate(fit, name, one) for name, one in fit.parameters.items()]
        heads = ("parameter", "symbol", "value", "unit", "standard deviation")
        tables.append(words("Parameters", found, heads).html())
    return "".join(tables)


def _record(data: Dataset) -> tuple[str, str]:
    return "record", f"{data.source or 'unnamed'}: {data!r}"


def records_table(fit: Identification) -> Table:
    """Write what each of several records has of its own."""
    heads = (
        "record",
        "weight",
        "rms error [um]",
        "% of its stroke",
        "largest [um]",
        "offset [um]",
        "delay [ms]",
        "begins",
    )
    rows = [
        (
            f"{i + 1}",
            f"{record.weight:g}",
            f"{1e6 * record.cost:.4g}",
            f"{record.cost_percent:.3g}",
            f"{1e6 * score.max_error:.4g}",
            f"{1e6 * record.offset:.4g}",
            f"{1e3 * record.delay:.4g}",
            record.start.history if record.start else "",
        )
        for i, (record, score) in enumerate(zip(fit.records, fit.scores, strict=True))
    ]
    return words("Records", rows, heads)


def _estimate(fit: Identification, name: str, estimate: Estimate) -> tuple[str, ...]:
    if not estimate.free and estimate.tie is None:
        deviation = "held"
    elif estimate.deviation is None:
        deviation = "" if estimate.at_bound else "unknown"
    else:
        deviation = (
            f"{estimate.deviation:.2g}" if math.isfinite(estimate.deviation) else "no effect"
        )
    return (
        name,
        estimate.symbol,
        f"{estimate.value:.6g}",
        estimate.unit,
        (deviation + parameter_notes(fit, name)).removeprefix(", "),
    )


def _constraint(constraint: Constraint) -> str:
    return constraint.text + (", active" if constraint.active else "")
