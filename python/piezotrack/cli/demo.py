"""``piezotrack demo``: from a measured log to a tracked reference, with the logs of the package."""

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
    seed: Annotated[int, typer.Option(help="Seed of the search and of simulated noise.")] = 1,
    paper: Annotated[
        bool,
        typer.Option("--paper", help="The simulated stage of Xu and Li 2010 and its Dahl model."),
    ] = False,
) -> None:
    """Identify a measured log, test the model on another, track with it."""
    can_be_folder(out)
    if paper:
        _paper(out, seed)
    else:
        _measured(out, seed)


def _measured(out: Path, seed: int) -> None:
    """Run the demonstration on the two measured logs of the package."""
    from .._support.files import make_folder, save_figures, together
    from ..control.demo import REFERENCE, WINDOW, run_demo
    from ..control.demo_plot import plot_before_and_after
    from ..data.log_file import write_log
    from ..identification.plot import plot_loop, plot_time
    from ..identification.report import save_identification

    found = run_demo(seed)
    fit, other = found.fit, found.other
    run = fit.simulate(other)
    figures = {
        "other_loop": plot_loop(other, run).figure,
        "other_time": plot_time(other, run, stroke=fit.stroke)[0].figure,
        "before_and_after": plot_before_and_after(found.runs),
    }
    with together(make_folder(out)) as folder:
        written = [
            write_log(found.log, folder / "log.csv"),
            write_log(other.full, folder / "other.csv"),
        ]
        written += save_identification(fit, folder)
        written += save_figures(figures, folder)  # type: ignore[arg-type]
    model, limits = written[2], "{:g}:{:g}".format(*fit.drive_range or ())
    print("Two measured logs of a piezo stack: 0 to 3.6 V, 45 um, 1 Hz, sampled at 200 Hz")
    print("(Aye and Ang 2018). The model is fitted to 20 s of the first.\n")
    # The head of the summary: the values of the parameters are in the model file.
    print(fit.summary().partition("\n\n")[0])
    print(f"\non the other log, not fitted: {found.score}\n")
    print(f"Tracking of {REFERENCE} with this model, simulated on a stage identified from the")
    print("other log:")
    for name, tracked in found.runs.items():
        print(f"  {name:<20} {tracked.metrics}")
    list_files(written)
    window = "{:g}:{:g}".format(*WINDOW)
    print("\nThe same by hand, and what else there is:")
    for line in (
        f"identify {written[0]} --window {window} --validate {written[1]} --validate-window 3:",
        f"compare {written[0]} --train {window}",
        f"track {model} --stage model --reference {REFERENCE} \\\n"
        f"      --dt 0.005 --limits {limits} --kp 0.03 --ti 0.02 --td 0",
        f"feedforward {model} {REFERENCE} --dt 0.005",
    ):
        print(f"  piezotrack {line}")


def _paper(out: Path, seed: int) -> None:
    """Run the demonstration of the paper: its stage, simulated, and its model."""
    from .._support.files import make_folder, save_figures, together
    from ..data.log_file import write_log
    from ..identification.report import save_identification
    from ..xu_li_2010.demo import demo_log, identify_demo, track_demo

    log = demo_log(seed)
    fit = identify_demo(log, seed=seed)
    rest = fit.score(log.full[fit.data.t[-1] :], offset=fit.offset)
    runs = track_demo(fit, seed)
    with together(make_folder(out)) as folder:
        written = [write_log(log, folder / "log.csv")]
        written += save_identification(fit, folder, shown=log)
        written += save_figures({f"track_{name}": run.plot() for name, run in runs.items()}, folder)
    print("The simulated stage of Xu and Li 2010, which no model matches exactly, is driven 12 s")
    print("with 0.25 Hz, 0 to 75 V. Mass, damping, stiffness and piezo coefficient are identified")
    print(
        "from the first 4 s; the hysteresis parameters are held, which sets the scale of forces.\n"
    )
    print(fit.summary())
    print(f"\nvalidation on the other 8 s: {rest}")
    print("\nTracking of a 0.2 Hz sine over 110 um, sampled at 50 Hz:")
    names = {"feedforward": "feedforward alone", "pid": "PID alone", "all": "both, repetitive"}
    for name, run in runs.items():
        print(f"  {names[name]:<18} {run.metrics}")
    list_files(written)
