"""``piezotrack identify``: from a log to a model."""

from __future__ import annotations

from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from ..._support.display.progress_parts import Parts
from ...errors import Interrupted, ParameterError
from ..command import Option, command, refuse_without_effect
from ..option_groups import LogOptions
from ..options import (
    TestLog,
    TestWindow,
    Threads,
    Windows,
    command_line,
    cut,
    driven_alike,
    of_file,
)
from ..output import Output
from ..process.interruption import acknowledge_interrupt
from ..values import TIME
from .fit_options import (
    AUTO,
    FitOptions,
    Kinds,
    LogFiles,
    MethodOptions,
    Models,
    ParameterOptions,
    RecordOptions,
    Runs,
    each_of,
    searched,
)
from .several_axes import identify_several, is_several

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ...data.dataset import Dataset
    from ...identification.fitted.identification import Identification
    from ...identification.problem.records import Record

__all__ = ["head_of", "identify_command"]

# Pictures of a test.
PANELS = ("loop", "time")


@command()
def identify_command(
    files: LogFiles,
    window: Windows = None,
    model: Models = None,
    test: TestLog = None,
    test_window: TestWindow = None,
    *,
    reading: LogOptions,
    sensor: RecordOptions,
    weight: Annotated[
        list[float] | None, Option("Weight of a sample of each log; default 1", metavar="NUMBER")
    ] = None,
    structure: MethodOptions,
    runs: Runs = None,
    seed: Annotated[int | None, Option("Seed of the random numbers; default 0")] = None,
    threads: Threads = None,
    checkpoint: Annotated[
        Path | None,
        Option("File of simulations, to continue after an interruption", metavar="FILE"),
    ] = None,
    period: Annotated[float | None, Option("Time after which an axis repeats", TIME)] = None,
    parameters: ParameterOptions,
    report: Annotated[
        Path | None, Option("Report for other readers, .html or .pdf", metavar="FILE")
    ] = None,
    output: Output,
) -> None:
    """Identify models of a stage, or of axes (--drive a,b or .npz), from logs."""
    if is_several(files, reading):
        identify_several(files, reading, period, output)
        return
    refuse_without_effect(["period"], "with one axis")
    from ...identification.comparison.validation import validated
    from ...identification.fitted.score import share_fitted
    from ...identification.views.report_page.page import write_report

    kinds = Kinds.checked(model)
    kinds.refuse_without_effect()
    options = FitOptions(**vars(parameters), **vars(structure), seed=seed, runs=runs)
    options.check()
    kinds.refuse_of_others(options.parameters())
    if window is not None and len(files) == 1:
        # Parts of one log are several records.
        files = files * len(window)
    sensor.check(len(files))
    weights = each_of("--weight", weight, len(files))
    if weight and len(files) == 1:
        raise ParameterError("--weight", "no effect with 1 log", "it left out", verb="has")
    if checkpoint is not None and len(kinds.names) > 1:
        raise ParameterError("--checkpoint", "given with several models", "one")
    if output.is_file and len(kinds.names) > 1:
        raise ParameterError("--out", f"'{output.out}' with several models", "a folder")
    if report is not None:
        _check_report(report, len(kinds.names), overwrite=output.overwrite)
    if test is None and test_window is not None and len(files) > 1:
        raise ParameterError(
            "--test-window", "given with several logs and no --test", "--test FILE"
        )
    windows = each_of("--window", window, len(files))
    whole = [reading.log(file) for file in files]
    logs = [cut(*one) for one in zip(whole, files, windows, strict=True)]
    second = None
    if test is not None or test_window is not None:
        judging = whole[0] if test is None else reading.log(test)
        driven_alike(test or files[0], judging, files[0], whole[0].drive_unit)
        second = cut(judging, test or files[0], test_window, "--test-window")
    records = _records(logs, sensor.of_each(len(logs)), weights)
    output.will_write(_files(kinds, logs, options, tested=second is not None))
    words: list[str] = []
    brief: list[str] = []
    documents: list[dict[str, Any]] = []
    written: list[Path] = []
    # About how long each takes.
    parts = Parts([5.0 if kind == AUTO or searched(kind) else 1.0 for kind in kinds.names])
    for i, kind in enumerate(kinds.names):
        with nullcontext() if len(files) > 1 else of_file(files[0]), parts.begin(i):
            fit = _search(
                records,
                output.folder,
                kind,
                **options.arguments_of(kind),
                threads=threads,
                progress=output.progress,
                checkpoint=checkpoint,
            )
        fit, score = (fit, None) if second is None else validated(fit, second)
        written += output.write(partial(_write, fit, second))
        if report is not None:
            written.append(write_report(fit, report, command=command_line()))
        # The result is complete: remove the file of an interrupted search.
        (output.folder / _unfinished(kind)).unlink(missing_ok=True)
        summary = fit.summary()
        words.append(summary)
        brief.append(head_of(summary))
        if second is not None and score is not None:
            own_offset = sensor.offset and score.fitted_share < 1.0
            refitted = ", with an offset of its own" if own_offset else ""
            span = f"from {second.t[0]:.6g} to {second.t[-1]:.6g} s"
            fitted = share_fitted(score.fitted_share)
            tested = f"on {second.source} {span}, {fitted}{refitted}: {score}"
            tested = "\n".join([tested, *(f"note  {note}" for note in score.notes)])
            words.append(tested)
            brief.append(tested)
        documents.append({**fit.document(), "notes": fit.notes})
    text = "\n\n".join(words)
    output.show(text, {"models": documents}, written, brief="\n\n".join(brief))


def head_of(summary: str) -> str:
    """Return the first lines of a summary and its notes, without details and parameters."""
    first = summary.partition("\n\n")[0].split("\n")
    return "\n".join(line for line in first if not line.startswith("      "))


def _records(
    logs: list[Dataset], of_each: list[dict[str, Any]], weights: list[float | None]
) -> list[Record]:
    """Make the records of the logs."""
    from ...identification.problem.records import Record, label_of, of_record

    records = []
    for i, (log, options, weight) in enumerate(zip(logs, of_each, weights, strict=True)):
        with of_record(label_of(log, i) if len(logs) > 1 else ""):
            records.append(Record(log, weight=1.0 if weight is None else float(weight), **options))
    return records


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
    kinds: Kinds, logs: list[Dataset], options: FitOptions, *, tested: bool
) -> Iterator[str]:
    """Names of all files that the command may write."""
    from ..._support.files.writing import picture_files
    from ...identification.solve.selecting.selection import models_tried
    from ...identification.views.files import identification_files

    names = [name for name in kinds.names if name != AUTO]
    if AUTO in kinds.names:
        names += [kind.name for kind in models_tried(logs[0], options.parameters())]
    for name in dict.fromkeys(names):
        yield from identification_files(name, searched=searched(name), records=len(logs))
        if tested:
            yield from picture_files(*(f"{name}_test_{panel}" for panel in PANELS))


def _unfinished(model: str) -> str:
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
        path = stopped.partial.save(make_folder(out) / _unfinished(kind))
        raise KeyboardInterrupt(f"{stopped}; the best so far is in {path}") from None


def _write(fit: Identification, second: Dataset | None, place: Path) -> list[Path]:
    """Write the model and the pictures, those of a test too."""
    from ..._support.files.writing import result_set, save_figures
    from ...identification.views.files import save_identification, shown_figures

    name = fit.model.info.name
    tested = {} if second is None else shown_figures(fit, second)
    figures = {f"{name}_test_{panel}": one for panel, one in tested.items()}
    with result_set(place) as folder:
        written = save_identification(fit, folder)
        written += save_figures(figures, folder)
    return written
