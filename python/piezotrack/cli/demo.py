"""``piezotrack demo``: identification and tracking on the virtual stage, without a log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .error_messages import in_words
from .options import Out, can_be_folder, list_files

__all__ = ["demo_command"]


@in_words
def demo_command(
    out: Out = Path("demo"),
    seed: Annotated[int, typer.Option(help="Seed of the noise and of the search.")] = 1,
) -> None:
    """Identify a model from a simulated log, and track a reference with it."""
    from .._support.files import make_folder, save_figures, together
    from ..identification.report import save_identification
    from ..xu_li_2010.demo import demo_log, identify_demo, track_demo, write_log

    log = demo_log(seed)
    can_be_folder(out)
    fit = identify_demo(log, seed=seed)
    rest = fit.score(log.full[fit.data.t[-1] :], offset=fit.offset)
    runs = track_demo(fit, seed)
    with together(make_folder(out)) as folder:
        written = [write_log(log, folder / "log.csv")]
        written += save_identification(fit, folder, shown=log)
        written += save_figures({f"track_{name}": run.plot() for name, run in runs.items()}, folder)
    print(
        "The virtual stage, which no model matches exactly, is driven 12 s with 0.25 Hz, 0 to 75 V."
    )
    print("Mass, damping, stiffness and piezo coefficient are identified from the first 4 s;")
    print("the hysteresis parameters are held fixed, which sets the scale of the forces.\n")
    print(fit.summary())
    print(f"\nvalidation on the other 8 s: {rest}")
    print("\nTracking of a 0.2 Hz sine over 110 um, sampled at 50 Hz:")
    names = {"feedforward": "feedforward alone", "pid": "PID alone", "all": "both, repetitive"}
    for name, run in runs.items():
        print(f"  {names[name]:<18} {run.metrics}")
    list_files(written)
