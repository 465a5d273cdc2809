"""``piezotrack identify``: from a log to a model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import Interrupted, ParameterError
from .options import (
    Columns,
    DisplacementColumn,
    DriveColumn,
    HoldOption,
    Interval,
    Out,
    Seconds,
    TimeColumn,
    Units,
    can_be_folder,
    list_files,
    number,
    number_range,
    of_file,
    pairs,
)
from .words import in_words

if TYPE_CHECKING:
    from ..dataset import Dataset
    from ..identification import Identification
    from ..identified import Score
    from ..swarm import ParticleSwarm

__all__ = ["identify_command"]


@in_words
def identify_command(
    file: Annotated[Path, typer.Argument(help="Log in CSV, with units in its header.")],
    window: Seconds = None,
    model: Annotated[str, typer.Option(help="Kind of stage: dahl or bouc-wen.")] = "dahl",
    out: Out = Path("results"),
    time: TimeColumn = None,
    drive: DriveColumn = None,
    displacement: DisplacementColumn = None,
    unit: Units = None,
    dt: Interval = None,
    hold: HoldOption = "foh",
    free: Annotated[
        str | None, typer.Option(metavar="A,B,...", help="Parameters to search; else all.")
    ] = None,
    fix: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="Parameter to hold, SI. Repeatable."),
    ] = None,
    bound: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=LOW:HIGH", help="Bounds of a parameter, SI. Repeatable."),
    ] = None,
    stiffness: Annotated[float | None, typer.Option(help="Stiffness in N/m, if known.")] = None,
    offset: Annotated[bool, typer.Option(help="Fit a constant offset of the sensor.")] = True,
    delay: Annotated[
        str | None,
        typer.Option(metavar="fit|S|LOW:HIGH", help="Delay of the displacement in s: fit it?"),
    ] = None,
    swarm: Annotated[
        str, typer.Option(help="Settings: default, xu-li-2010 or spso-2011.")
    ] = "default",
    seed: Annotated[int, typer.Option(help="Same seed, same result.")] = 0,
    runs: Annotated[int, typer.Option(help="Swarms that search apart; do they agree?")] = 4,
    threads: Annotated[int | None, typer.Option(help="Up to 256; else all cores.")] = None,
    validate: Annotated[
        Path | None, typer.Option(help="A second log, to judge the model on; not fitted.")
    ] = None,
    validate_window: Seconds = None,
) -> None:
    """Identify a stage from a log: a table, a JSON model, pictures."""
    columns = Columns(time, drive, displacement, unit, dt)
    if validate is None and validate_window is not None:
        raise ParameterError("--validate-window is given without --validate")
    log = _windowed(columns.read(file, hold), file, "--window", window)
    second = None
    if validate is not None:
        whole = columns.read(validate, hold)
        second = _windowed(whole, validate, "--validate-window", validate_window)
    can_be_folder(out)
    arguments = {
        "model": model,
        "free": None if free is None else [name.strip() for name in free.split(",")],
        "fixed": {name: number("--fix", text) for name, text in pairs("--fix", fix)},
        "bounds": {name: number_range("--bound", text) for name, text in pairs("--bound", bound)},
        "stiffness": stiffness,
        "offset": offset,
        "delay": _delay(delay),
        "swarm": _swarm(swarm),
        "seed": seed,
        "runs": runs,
        "threads": threads,
    }
    with of_file(file):
        fit = _search(log, out, **arguments)
    score = None if second is None else fit.score(second)
    written = _write(fit, out, second, score)
    print(fit.summary())
    if second is not None and score is not None:
        own = ", with an offset of its own" if offset else ""
        first, last = second.t[0], second.t[-1]
        print(f"\non {second.source} from {first:.6g} to {last:.6g} s, not fitted{own}: {score}")
    list_files(written)


def _windowed(log: Dataset, file: Path, option: str, window: str | None) -> Dataset:
    if window is None:
        return log
    start, colon, stop = window.partition(":")
    if not colon:
        raise ParameterError(f"{option} is '{window}': expected A:B in seconds, as 3:23")
    bounds = [number(option, text) if text else None for text in (start, stop)]
    try:
        return log[bounds[0] : bounds[1]]
    except ParameterError as error:
        raise ParameterError(f"{file.name}: {option} {window}: {error}") from None


def _partial(model: str) -> str:
    """Name of the file that an interrupted search leaves."""
    return f"{model}.partial.json"


def _search(log: Dataset, out: Path, **arguments: Any) -> Identification:
    """Identify; on Ctrl-C keep the best so far as a file."""
    from ..identification import identify
    from ..report import make_folder

    try:
        return identify(log, **arguments)
    except Interrupted as stopped:
        if stopped.partial is None:
            raise
        path = stopped.partial.save(make_folder(out) / _partial(arguments["model"]))
        raise KeyboardInterrupt(f"{stopped}; the best so far is in {path}") from None


def _write(
    fit: Identification, out: Path, second: Dataset | None, score: Score | None
) -> list[Path]:
    """Write the model, with what it is worth on a second log, and the pictures."""
    from ..kinds import kind_of
    from ..plotting import plot_loop, plot_time
    from ..report import save_figures, save_identification

    if second is None or score is None:
        written = save_identification(fit, out)
    else:
        judged = {
            "source": second.source,
            "sha256": second.sha256,
            "window_s": [float(second.t[0]), float(second.t[-1])],
            "rms": {"value": score.rms, "unit": "m"},
            "max_error": {"value": score.max_error, "unit": "m"},
            "offset": {"value": score.offset, "unit": "m"},
        }
        fit = replace(fit, details={**fit.details, "validation": judged})
        written = save_identification(fit, out)
        run = fit.simulate(second)
        figures = {
            "validation_loop": plot_loop(second, run).figure,
            "validation_time": plot_time(second, run, stroke=fit.stroke)[0].figure,
        }
        written += save_figures(figures, out)  # type: ignore[arg-type]
    # The result is whole now; what an interrupted search left is not needed.
    (out / _partial(kind_of(fit.model).name)).unlink(missing_ok=True)
    return written


def _swarm(name: str) -> ParticleSwarm | None:
    from ..swarm import ParticleSwarm

    known = {
        "default": None,
        "xu-li-2010": ParticleSwarm.xu_li_2010(),
        "spso-2011": ParticleSwarm.spso_2011(),
    }
    if name not in known:
        raise ParameterError(f"--swarm is '{name}': expected {', '.join(known)}")
    return known[name]


def _delay(text: str | None) -> bool | float | tuple[float, float]:
    if text is None or text == "fit":
        return text is not None
    return number_range("--delay", text) if ":" in text else number("--delay", text)
