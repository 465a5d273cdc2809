"""``piezotrack identify``: from a log to a model."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..._support.display.progress_parts import Parts
from ...errors import Interrupted, ParameterError
from ..error_messages import report_errors
from ..interruption import acknowledge_interrupt
from ..option_groups import HeldLogOptions, with_groups
from ..options import Json, Out, Overwrite, Quiet, Seconds, command_line, of_file, windowed
from ..output import Output
from .fit_options import (
    AUTO,
    Delays,
    Drifts,
    FitOptions,
    Histories,
    Kinds,
    KindsNamed,
    LogFiles,
    MethodOptions,
    ParameterOptions,
    Weights,
    Windows,
    check_each_log,
    each_of,
    of_each_log,
    searched,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ...data.dataset import Dataset
    from ...identification.fitted.identification import Identification
    from ...identification.fitted.score import Score
    from ...identification.problem.records import Record

__all__ = ["identify_command"]

# Pictures of a second log.
PANELS = ("loop", "time")


@report_errors
@with_groups
def identify_command(
    context: typer.Context,
    files: LogFiles,
    window: Windows = None,
    weight: Weights = None,
    model: KindsNamed = None,
    out: Out = Path("results"),
    overwrite: Overwrite = False,
    *,
    reading: HeldLogOptions,
    parameters: ParameterOptions,
    offset: Annotated[bool, typer.Option(help="Fit a constant sensor offset.")] = True,
    delay: Delays = None,
    drift: Drifts = None,
    history: Histories = None,
    searching: MethodOptions,
    seed: Annotated[int | None, typer.Option(help="Seed of the random numbers; default 0.")] = None,
    runs: Annotated[
        int | None,
        typer.Option(help="Number of independent searches; default 1, of swarms 4."),
    ] = None,
    threads: Annotated[
        int | None, typer.Option(help="Number of threads, up to 256; default all cores.")
    ] = None,
    checkpoint: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Keep simulations here, to go on after an interruption; none."
        ),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Report for other readers, .html or .pdf; default none."),
    ] = None,
    validate: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Second log, for validation only; default none."),
    ] = None,
    validate_window: Seconds = None,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Identify models of a stage from one log or several."""
    from ...identification.fitted.score import share_fitted
    from ...identification.views.report_page.page import write_report

    kinds = Kinds.checked(model)
    kinds.refuse_without_effect(context)
    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    options = FitOptions(**vars(parameters), **vars(searching), seed=seed, runs=runs)
    options.check()
    kinds.refuse_of_others(context)
    check_each_log(len(files), delay=delay, drift=drift, history=history, weight=weight)
    if checkpoint is not None and len(kinds.names) > 1:
        raise ParameterError("--checkpoint", "given with several models", "one")
    if report is not None:
        _check_report(report, len(kinds.names), overwrite=overwrite)
    if validate is None and validate_window is not None:
        raise ParameterError("--validate-window is given without --validate")
    windows = each_of("--window", window, len(files))
    logs = [
        windowed(reading.log(file, reading.hold), file, "--window", one)
        for file, one in zip(files, windows, strict=True)
    ]
    second = None
    if validate is not None:
        whole = reading.log(validate, reading.hold)
        second = windowed(whole, validate, "--validate-window", validate_window)
    records = of_each_log(
        logs, offset=offset, delay=delay, drift=drift, history=history, weight=weight
    )
    result.will_write(_files(kinds, logs, options, validated=second is not None))
    words: list[str] = []
    documents: list[dict[str, Any]] = []
    written: list[Path] = []
    # About how long each takes.
    parts = Parts([5.0 if kind == AUTO or searched(kind) else 1.0 for kind in kinds.names])
    for i, kind in enumerate(kinds.names):
        with nullcontext() if len(files) > 1 else of_file(files[0]), parts.begin(i):
            fit = _search(
                records,
                out,
                kind,
                **options.arguments_of(kind),
                threads=threads,
                progress=result.progress,
                checkpoint=checkpoint,
            )
        fit, score = _judged(fit, second)
        written += _write(fit, out, second)
        if report is not None:
            written.append(write_report(fit, report, command=command_line(context)))
        # The result is complete: remove the file of an interrupted search.
        (out / _partial(kind)).unlink(missing_ok=True)
        words.append(fit.summary())
        if second is not None and score is not None:
            refitted = ", with an offset of its own" if offset and score.fitted_share < 1.0 else ""
            span = f"from {second.t[0]:.6g} to {second.t[-1]:.6g} s"
            fitted = share_fitted(score.fitted_share)
            words.append(f"on {second.source} {span}, {fitted}{refitted}: {score}")
            words += [f"note  {note}" for note in score.notes]
        documents.append({**fit.document(), "notes": fit.notes})
    result.show("\n\n".join(words), {"models": documents}, written)


def _check_report(report: Path, models: int, *, overwrite: bool) -> None:
    """Refuse a report that cannot be written before the computation."""
    from ..._support.page.file import page_file

    page_file("--report", report)
    if models > 1:
        raise ParameterError("--report", "given with several models", "one")
    if not report.parent.is_dir():
        raise ParameterError("--report", f"'{report}'", "a file in a folder that exists")
    if report.exists() and not overwrite:
        raise ParameterError(f"{report} exists: expected --overwrite, or another --report")


def _files(
    kinds: Kinds, logs: list[Dataset], options: FitOptions, *, validated: bool
) -> Iterator[str]:
    """Names of all files that the command may write."""
    from ..._support.files.writing import picture_files
    from ...identification.solve.selection import models_tried
    from ...identification.views.files import identification_files

    names = [name for name in kinds.names if name != AUTO]
    if AUTO in kinds.names:
        names += [kind.name for kind in models_tried(logs[0], options.parameters())]
    for name in dict.fromkeys(names):
        yield from identification_files(name, searched=searched(name), records=len(logs))
        if validated:
            yield from picture_files(*(f"{name}_validation_{panel}" for panel in PANELS))


def _partial(model: str) -> str:
    """Name of the file that an interrupted search leaves."""
    return f"{model}.partial.json"


def _search(records: list[Record], out: Path, kind: str, **arguments: Any) -> Identification:
    """Identify; on Ctrl-C save the best model found so far."""
    from ..._support.files.writing import make_folder
    from ...identification.fit import identify

    try:
        return identify(records[0] if len(records) == 1 else records, kind, **arguments)
    except Interrupted as stopped:
        acknowledge_interrupt()
        if stopped.partial is None:
            raise
        path = stopped.partial.save(make_folder(out) / _partial(kind))
        raise KeyboardInterrupt(f"{stopped}; the best so far is in {path}") from None


def _judged(fit: Identification, second: Dataset | None) -> tuple[Identification, Score | None]:
    """Score a fit on a second log; the result goes into the file of the model."""
    if second is None:
        return fit, None
    score = fit.score(second)
    judged = {
        "source": second.source,
        "sha256": second.sha256,
        "window_s": [float(second.t[0]), float(second.t[-1])],
        "rms": {"value": score.rms, "unit": "m"},
        "max_error": {"value": score.max_error, "unit": "m"},
        "max_error_time": {"value": score.max_error_time, "unit": "s"},
        "fitted_share": score.fitted_share,
        "fit_percent": {"value": score.fit_percent, "unit": "%"},
        "offset": {"value": score.offset, "unit": "m"},
    }
    return replace(fit, details={**fit.details, "validation": judged}), score


def _write(fit: Identification, out: Path, second: Dataset | None) -> list[Path]:
    """Write the model and the pictures, those of a second log too."""
    from ..._support.files.writing import make_folder, result_set, save_figures
    from ...identification.views.files import save_identification
    from ...identification.views.plot import band_of, plot_loop, plot_time, what_was_shown

    name = fit.model.info.name
    figures = {}
    if second is not None:
        run = fit.simulate(second)
        title = what_was_shown(fit, second, run)
        axes = (
            plot_loop(second, run, title=title),
            plot_time(second, run, stroke=fit.stroke, half=band_of(fit, second), title=title)[0],
        )
        figures = {
            f"{name}_validation_{panel}": one.figure
            for panel, one in zip(PANELS, axes, strict=True)
        }
    with result_set(make_folder(out)) as folder:
        written = save_identification(fit, folder)
        written += save_figures(figures, folder)  # type: ignore[arg-type]
    return written
