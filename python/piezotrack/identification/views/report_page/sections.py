"""Sections of the report; each is None where a fit has no content for it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from ...._support.display.table import words
from ...._support.page.parts import Listing, Picture, Section, Sentences
from ...._support.units import length_text, of_drive, shown_unit
from ...confidence.residuals.residual import residual_of
from ..confidence.residual_report import fit_notes, verdict
from ..html import records_table
from ..plot import band_of, plot_loop, plot_record, plot_time, what_was_fitted
from ..quantities import errors_of, of_sensor, of_stage, predicted
from ..report import list_sentences, parameter_notes, search_sentences, verdict_sentences

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure, SubFigure

    from ...._support.display.result import Result
    from ...._support.display.table import Table
    from ...._support.page.parts import Part
    from ....data.dataset import Dataset
    from ...fitted.estimates import Estimate
    from ...fitted.fitted_record import FittedRecord
    from ...fitted.identification import Identification

__all__ = [
    "controller",
    "motion",
    "overview",
    "parameters",
    "records",
    "residual",
    "search",
    "suggestion",
    "verdicts",
]

# Confidence of the intervals, and the records that are drawn at most.
LEVEL = 0.95
DRAWN = 4


def overview(fit: Identification) -> Section:
    """Write gain, loop, error and noise."""
    rows = list(of_stage(fit))
    if len(fit.records) == 1:
        rows += [*of_sensor(fit.records[0], fit.data), *errors_of(fit, 0)]
        rows.append(("record", f"{_window(fit.data)}, {_size(fit.data)}"))
    else:
        share = f"{fit.cost_percent:.3g} % of the largest stroke"
        rows.append(("rms error", f"{length_text(fit.cost, 3)} of all records ({share})"))
        rows.append(("fit", f"{fit.fit_percent:.4g} % of the motion"))
    return Section("", (words("", [*rows, *predicted(fit), *_validation(fit)]),))


def _window(data: Dataset) -> str:
    return f"{float(data.t[0]):.6g} to {float(data.t[-1]) + data.dt:.6g} s"


def _size(data: Dataset) -> str:
    data = data.measured
    rate = f"{len(data)} samples at {1.0 / data.dt:.6g} Hz"
    return f"{rate}, stroke {length_text(data.stroke)}"


def _validation(fit: Identification) -> Iterator[tuple[str, str]]:
    """Write the error on a second log, where the fit was judged on one."""
    judged: Any = fit.details.get("validation")
    if judged:
        rms = judged["rms"]["value"]
        share = f"{100.0 * rms / fit.stroke:.3g} % of stroke"
        source = judged["source"] or "another record"
        yield "validation", f"rms error {length_text(rms, 3)} ({share}) on {source}"


def records(fit: Identification) -> Section | None:
    """List the records, where there are several."""
    if len(fit.records) < 2:
        return None
    rows = [
        (f"{i + 1}", one.data.source or "unnamed", f"{_window(one.data)}, {_size(one.data)}")
        for i, one in enumerate(fit.records)
        if one.data is not None
    ]
    return Section("Records", (words("", rows), replace(records_table(fit), title="")))


def motion(fit: Identification) -> Section:
    """Draw loop, displacement and error, of several records those that fit worst."""
    shown = [(i, one) for i, one in enumerate(fit.records) if one.data is not None]
    if len(shown) == 1:
        return Section("Measured and simulated", (_loop(fit), _time(fit)))
    worst = sorted(shown, key=lambda pair: -pair[1].cost_percent)[:DRAWN]
    pictures: list[Part] = [
        Picture(
            f"record-{i + 1}",
            partial(_both, fit, record),
            3.1,
            f"record {i + 1}: loop, displacement and error, measured and simulated",
        )
        for i, record in sorted(worst, key=lambda pair: pair[0])
    ]
    left_out = len(shown) - len(pictures)
    if left_out:
        pictures.append(Sentences((f"{left_out} records with smaller errors are not drawn.",)))
    return Section("Measured and simulated", tuple(pictures))


def _loop(fit: Identification) -> Picture:
    def draw(figure: Figure | SubFigure) -> None:
        run = fit.simulate(fit.data, offset=fit.offset)
        plot_loop(fit.data, run, figure.subplots())

    return Picture("loop", draw, 3.1, "hysteresis loop, measured and simulated")


def _time(fit: Identification) -> Picture:
    def draw(figure: Figure | SubFigure) -> None:
        run = fit.simulate(fit.data, offset=fit.offset)
        above, below = figure.subplots(2, 1, sharex=True)
        half = band_of(fit, fit.data)
        plot_time(fit.data, run, (above, below), stroke=fit.stroke, half=half)

    return Picture("time", draw, 3.6, "displacement and error over time")


def _both(fit: Identification, record: FittedRecord, figure: Figure | SubFigure) -> None:
    """Draw loop, displacement and error of one of several records side by side."""
    data = record.data
    assert data is not None
    run = fit.simulate(data, offset=record.offset)
    axes = figure.subplot_mosaic([["loop", "time"], ["loop", "error"]], width_ratios=[1.0, 1.5])
    plot_record(data, run, axes, stroke=record.stroke, half=band_of(fit, data))
    below = axes["error"]
    below.set_title(below.get_title().removeprefix("error = measured - simulated: "), fontsize=8)
    figure.suptitle(what_was_fitted(fit, record), fontsize="medium")


def residual(fit: Identification) -> Section:
    """Draw the residual of the record that fits worst, and write its cause."""
    worst = max(
        (i for i, one in enumerate(fit.records) if one.data is not None),
        key=lambda i: fit.records[i].cost_percent,
    )
    judged = residual_of(fit, worst)

    def draw(figure: Figure | SubFigure) -> None:
        judged.plot(fig=figure)
        # The cause is in the text.
        figure.suptitle("")
        for axes in figure.axes:
            axes.set_title(axes.get_title().partition(":")[0], fontsize=8)

    which = f" of record {worst + 1}" if len(fit.records) > 1 else ""
    picture = Picture("residual", draw, 4.8, f"residual{which}: where it is large")
    return Section("Residual", (Sentences((f"Cause: {verdict(judged)}.",)), picture))


def parameters(fit: Identification) -> Section:
    """List the parameters with their intervals."""
    parts: list[Part] = [_estimates(fit) if fit.parameters else _values(fit)]
    if lists := list_sentences(fit):
        parts.append(Sentences(tuple(f"{one}." for one in lists)))
    return Section("Parameters", tuple(parts))


def _estimates(fit: Identification) -> Table:
    rows = [
        (
            name.replace("_", " "),
            one.symbol,
            f"{one.value:.6g}",
            _interval(fit, name),
            one.unit,
            _remark(one) + parameter_notes(fit, name),
        )
        for name, one in fit.parameters.items()
    ]
    heads = ("parameter", "symbol", "value", f"{100 * LEVEL:g} % interval", "unit", "remark")
    return words("", [(*row[:-1], row[-1].removeprefix(", ")) for row in rows], heads)


def _interval(fit: Identification, name: str, scale: float = 1.0) -> str:
    """Write the interval of a value."""
    covariance = fit.covariance
    if covariance is None or name not in covariance.names:
        return ""
    lower, upper = covariance.interval(name, LEVEL)
    return f"{scale * lower:.4g} to {scale * upper:.4g}" if math.isfinite(upper) else ""


def _remark(estimate: Estimate) -> str:
    moves = estimate.free or estimate.tie is not None
    if estimate.deviation is not None and not math.isfinite(estimate.deviation):
        return "no effect on the data" if moves else "held: no effect on the data"
    if not moves or estimate.deviation == 0.0:
        return "held"
    known = estimate.deviation is not None or estimate.at_bound
    return "" if known else "interval unknown"


def _values(fit: Identification) -> Table:
    rows = []
    for one in fit.model.info.parameters:
        value = getattr(fit.model, one.name)
        if value is not None and not one.is_list:
            unit, scale = shown_unit(of_drive(one.unit, fit.drive_unit))
            interval = _interval(fit, one.name, scale)
            name = one.name.replace("_", " ")
            rows.append((name, one.symbol, f"{scale * value:.6g}", interval, unit))
    heads = ("parameter", "symbol", "value", f"{100 * LEVEL:g} % interval", "unit")
    return words("", rows, heads)


def verdicts(fit: Identification) -> Section | None:
    """Write what the data determine, and the warnings."""
    lines = [*verdict_sentences(fit), *(f"{one[:1].upper()}{one[1:]}." for one in fit_notes(fit))]
    return Section("Verdicts", (Sentences(tuple(lines), listed=True),)) if lines else None


def search(fit: Identification) -> Section:
    """Write how the model was found, and which others were tried."""
    lines = tuple(f"{one[:1].upper()}{one[1:]}." for one in search_sentences(fit))
    parts: list[Part] = [Sentences(lines)]
    if (chosen := fit.selection) is not None:
        until = f"Models fitted up to {chosen.fitted_until:.4g} s, judged by their rms after it"
        rows = [
            (
                one.title,
                length_text(one.rms, 3),
                f"{100 * one.rms / fit.stroke:.3g} %",
                _chosen(fit, one.title),
            )
            for one in chosen.trials
        ]
        parts.append(words(until, rows, ("model", "rms error", "of stroke", "")))
    return Section("How the model was found", tuple(parts))


def _chosen(fit: Identification, title: str) -> str:
    return "chosen" if title == fit.model.info.title else ""


def suggestion(result: Result | None) -> Section | None:
    """Write and draw a suggested drive."""
    if result is None:
        return None

    def draw(figure: Figure | SubFigure) -> None:
        result.plot(fig=figure)

    # Its picture has a row for each parameter, so that the table of its text is left out.
    height = max(3.6, 1.0 + 0.13 * len(getattr(result, "parameters", ())))
    picture = Picture(
        "suggestion", draw, min(height, 9.0), "suggested drive, and the deviations to expect"
    )
    drive = result.summary().partition("\n\n")[0]
    return Section("What to measure next", (Listing(drive), picture))


def controller(result: Result | None) -> Section | None:
    """Write a tuned controller with its margins, and draw its first run."""
    if result is None:
        return None
    text = Listing(result.summary())
    runs: tuple[Any, ...] = getattr(result, "runs", ())
    if not runs:
        return Section("Controller", (text,))

    def draw(figure: Figure | SubFigure) -> None:
        runs[0].plot(fig=figure)

    picture = Picture("controller", draw, 4.4, "the loop with the controller along a reference")
    return Section("Controller", (text, picture))
