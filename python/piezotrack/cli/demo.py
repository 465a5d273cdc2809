"""``piezotrack demo``: identification and tracking on the virtual stage, without a log."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from .error_messages import in_words
from .options import Json, Out, Overwrite, Quiet  # noqa: TC001 - read by typer
from .output import Output

__all__ = ["demo_command"]

# The runs of the demonstration in words.
RUNS = {"feedforward": "feedforward alone", "pid": "PID alone", "all": "both, repetitive"}


@in_words
def demo_command(
    out: Out = Path("demo"),
    overwrite: Overwrite = False,
    seed: Annotated[int, typer.Option(help="Seed of the noise and of the search.")] = 1,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Identify and track a built-in stage, without a log."""
    from .._support.files import make_folder, picture_files, save_figures, together
    from ..identification.report import identification_files, save_identification
    from ..xu_li_2010.demo import demo_log, identify_demo, track_demo, write_log

    result = Output(out, overwrite=overwrite, json=json, quiet=quiet)
    tracked = picture_files(*(f"track_{name}" for name in RUNS))
    result.will_write(["log.csv", *identification_files("dahl", searched=True), *tracked])
    log = demo_log(seed)
    fit = identify_demo(log, seed=seed, progress=result.progress)
    rest = fit.score(log.full[fit.data.t[-1] :], offset=fit.offset)
    runs = track_demo(fit, seed)
    with together(make_folder(out)) as folder:
        written = [write_log(log, folder / "log.csv")]
        written += save_identification(fit, folder, shown=log)
        written += save_figures({f"track_{name}": run.plot() for name, run in runs.items()}, folder)
    words = [
        "A virtual stage that no model matches exactly is driven for 12 s at 0.25 Hz, 0 to 75 V.",
        "Mass, damping, stiffness and piezo coefficient are identified from the first 4 s;",
        "the hysteresis parameters are held fixed, which sets the scale of the forces.",
        "",
        fit.summary(),
        "",
        f"validation on the other 8 s: {rest}",
        "",
        "Tracking of a 0.2 Hz sine over 110 um, sampled at 50 Hz:",
        *(f"  {RUNS[name]:<18} {run.metrics}" for name, run in runs.items()),
    ]
    document = {
        "model": {**fit.document(), "notes": fit.notes},
        "validation": {**asdict(rest), "fit_percent": rest.fit_percent},
        "tracking": {name: asdict(run.metrics) for name, run in runs.items()},
        "unit": "errors in m, phase lag in rad, widest loop as a part of the travel",
    }
    result.show("\n".join(words), document, written)
