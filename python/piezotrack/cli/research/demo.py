"""``piezotrack demo``: from a measured log to a tracked reference, with the logs of the package."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from ..command import Option, command
from ..identify.identify import head_of
from ..options import Seed
from ..output import Output

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ...control.loop.tracking import Tracking
    from ...identification.fitted.identification import Identification

__all__ = ["demo_command"]

UNIT = "errors in m, phase lag in rad, widest loop as a part of the travel"
# Of the measured logs, and of the paper.
PICTURES = ("other_loop", "other_time", "before_and_after")
# Lines of the summary that are left out here.
LESS = ("  drift", "  offset", "  start", "  limit", "  record", "note")
RUNS = {"feedforward": "feedforward alone", "pid": "PID alone", "all": "both, repetitive"}


@command(out=Path("demo"))
def demo_command(
    paper: Annotated[
        bool, Option("The simulated stage of Xu and Li 2010 and its Dahl model")
    ] = False,
    seed: Seed = 1,
    *,
    output: Output,
) -> None:
    """Identify a measured log, test on another, track."""
    (_paper if paper else _measured)(output, seed)


def _measured(output: Output, seed: int) -> None:
    """Run the demonstration on the two measured logs of the package."""
    from ..._support.files.writing import picture_files, result_set, save_figures
    from ...data.log_file import write_log
    from ...identification.views.files import (
        identification_files,
        save_identification,
        shown_figures,
    )
    from .demonstration import run_demo
    from .loop_plot import plot_before_and_after

    # The logs are known, and so is the model that suits them.
    model = identification_files("asymmetric-prandtl-ishlinskii", searched=False)
    output.will_write(["log.csv", "other.csv", *model, *picture_files(*PICTURES)])
    demo = run_demo(seed, progress=output.progress)
    fit, other = demo.fit, demo.other
    figures = (*shown_figures(fit, other).values(), plot_before_and_after(demo.runs))

    def save(place: Path) -> list[Path]:
        with result_set(place) as folder:
            return [
                write_log(demo.log, folder / "log.csv"),
                write_log(other.full, folder / "other.csv"),
                *save_identification(fit, folder),
                *save_figures(dict(zip(PICTURES, figures, strict=True)), folder),
            ]

    words = [
        "Two measured logs of a piezo stack: 0 to 3.6 V, 45 um, 1 Hz, sampled at 200 Hz",
        "(Aye and Ang 2018). The model is fitted to 20 s of the first.",
        "",
        *_brief_of(fit),
        "",
        f"on the other log, not fitted: {demo.score}",
        "",
        "Tracking of a 1 Hz triangle from 5 to 42 um with this model, simulated on a stage",
        "identified from the other log:",
        *_runs({name: name for name in demo.runs}, demo.runs),
        "",
        "The same by hand, and more:",
        *(f"  piezotrack {line}" for line in _commands(output.folder, fit.model.info.name)),
        f"In the browser: piezotrack app {output.folder / 'log.csv'}",
    ]
    document = {
        "model": {**fit.document(), "notes": fit.notes},
        "validation": asdict(demo.score),
        "tracking": {name: asdict(one.metrics) for name, one in demo.runs.items()},
        "unit": UNIT,
    }
    output.show("\n".join(words), document, output.write(save))


def _commands(out: Path, name: str) -> list[str]:
    """Return what to type next."""
    from .demonstration import FEEDBACK, NOISE, REFERENCE, WINDOW

    log, other, model = (out / name for name in ("log.csv", "other.csv", f"{name}.json"))
    window = "{:g}:{:g}".format(*WINDOW)
    return [
        f"identify {log} --window {window} --test {other} --test-window 3:",
        f"compare {log} --window {window}",
        f"track {model} {REFERENCE} --kp {1e-6 * FEEDBACK.kp:g} "
        f"--ti {1e3 * FEEDBACK.ti:g}ms --noise {1e9 * NOISE:g}nm",
        f"feedforward {model} {REFERENCE}",
    ]


def _paper(output: Output, seed: int) -> None:
    """Run the demonstration of the paper: its stage, simulated, and its model."""
    from ..._support.files.writing import picture_files, result_set, save_figures
    from ...data.log_file import write_log
    from ...identification.views.files import identification_files, save_identification
    from ...xu_li_2010.demo import demo_log, identify_demo, track_demo

    tracked = picture_files(*(f"track_{name}" for name in RUNS))
    output.will_write(["log.csv", *identification_files("dahl", searched=True), *tracked])
    log = demo_log(seed)
    fit = identify_demo(log, seed=seed, progress=output.progress)
    rest = fit.score(log.full[fit.data.t[-1] :], offset=fit.offset)
    runs = track_demo(fit, seed)

    def save(place: Path) -> list[Path]:
        with result_set(place) as folder:
            pictures = {f"track_{name}": run.plot() for name, run in runs.items()}
            return [
                write_log(log, folder / "log.csv"),
                *save_identification(fit, folder, shown=log),
                *save_figures(pictures, folder),
            ]

    words = [
        "A virtual stage that no model matches exactly is driven for 12 s at 0.25 Hz, 0 to 75 V.",
        "Mass, damping, stiffness and piezo coefficient are identified from the first 4 s;",
        "the hysteresis parameters are held fixed, which sets the scale of the forces.",
        "",
        *_brief_of(fit),
        "",
        f"test on the other 8 s: {rest}",
        "",
        "Tracking of a 0.2 Hz sine over 110 um, sampled at 50 Hz:",
        *_runs(RUNS, runs),
    ]
    document = {
        "model": {**fit.document(), "notes": fit.notes},
        "validation": {**asdict(rest), "fit_percent": rest.fit_percent},
        "tracking": {name: asdict(run.metrics) for name, run in runs.items()},
        "unit": UNIT,
    }
    output.show("\n".join(words), document, output.write(save))


def _brief_of(fit: Identification) -> list[str]:
    """Return lines of a summary; the values of the parameters are in the model file."""
    lines = head_of(fit.summary()).split("\n")
    return [line for line in lines if not line.startswith(LESS)]


def _runs(names: Mapping[str, str], runs: Mapping[str, Tracking]) -> list[str]:
    return [f"  {names[name]:<20} {run.metrics}" for name, run in runs.items()]
