"""``piezotrack identify``: from a log to a model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import Interrupted, ParameterError
from .error_messages import in_words
from .interruption import heard
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
    refuse_without_effect,
    windowed,
)

if TYPE_CHECKING:
    from ..data.dataset import Dataset
    from ..identification.identified import Score
    from ..identification.result import Identification
    from ..identification.swarm import ParticleSwarm

__all__ = ["identify_command"]


@in_words
def identify_command(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="Log in CSV, with units in its header.")],
    window: Seconds = None,
    model: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MODEL",
            help="Stage model, as dahl or bouc-wen, repeatable; default auto, the best of them.",
        ),
    ] = None,
    out: Out = Path("results"),
    time: TimeColumn = None,
    drive: DriveColumn = None,
    displacement: DisplacementColumn = None,
    unit: Units = None,
    dt: Interval = None,
    hold: HoldOption = "foh",
    free: Annotated[
        str | None, typer.Option(metavar="A,B,...", help="Parameters to identify; default all.")
    ] = None,
    fix: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE", help="Parameter to hold fixed, in SI units. Repeatable."
        ),
    ] = None,
    bound: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=LOW:HIGH", help="Bounds of a parameter, in SI units. Repeatable."
        ),
    ] = None,
    stiffness: Annotated[float | None, typer.Option(help="Stiffness in N/m, if known.")] = None,
    offset: Annotated[bool, typer.Option(help="Fit a constant sensor offset.")] = True,
    delay: Annotated[
        str | None,
        typer.Option(
            metavar="fit|S|LOW:HIGH",
            help="Delay of the displacement in s: fitted, known, or bounds.",
        ),
    ] = None,
    history: Annotated[
        str | None,
        typer.Option(
            metavar="virgin|settled|fit",
            help="What the stage went through before the log; default what the log shows.",
        ),
    ] = None,
    creep: Annotated[
        str | None,
        typer.Option(
            metavar="fit|S,S,...",
            help="Creep, its time constants in s: from the record, or known; weights fitted.",
        ),
    ] = None,
    swarm: Annotated[
        str | None, typer.Option(help="Swarm settings: default, xu-li-2010 or spso-2011.")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the random numbers; default 0.")] = None,
    runs: Annotated[
        int | None, typer.Option(help="Number of independent restarts; default 4.")
    ] = None,
    threads: Annotated[
        int | None, typer.Option(help="Number of threads, up to 256; default all cores.")
    ] = None,
    validate: Annotated[Path | None, typer.Option(help="Second log, for validation only.")] = None,
    validate_window: Seconds = None,
) -> None:
    """Identify stage models from a log: a table, the model as JSON, pictures."""
    kinds = _kinds(model)
    if not any(_searched(kind) for kind in kinds):
        refuse_without_effect(
            context,
            ("seed", "runs", "threads"),
            f"with the model {', '.join(kinds)}, whose parameters follow by least squares",
        )
    columns = Columns(time, drive, displacement, unit, dt)
    if validate is None and validate_window is not None:
        raise ParameterError("--validate-window is given without --validate")
    log = windowed(columns.read(file, hold), file, "--window", window)
    second = None
    if validate is not None:
        whole = columns.read(validate, hold)
        second = windowed(whole, validate, "--validate-window", validate_window)
    can_be_folder(out)
    options = {
        "free": None if free is None else [name.strip() for name in free.split(",")],
        "fixed": {name: number("--fix", text) for name, text in pairs("--fix", fix)} or None,
        "bounds": {name: number_range("--bound", text) for name, text in pairs("--bound", bound)}
        or None,
        "stiffness": stiffness,
        "offset": offset,
        "delay": _delay(delay),
        "history": history,
        "creep": _creep(creep),
        "swarm": _swarm(swarm),
        "seed": seed,
        "runs": runs,
        "threads": threads,
    }
    arguments = {name: value for name, value in options.items() if value is not None}
    printed: list[str] = []
    written: list[Path] = []
    for kind in kinds:
        with of_file(file):
            fit = _search(log, out, kind, **_of_model(kind, kinds, arguments))
        score = None if second is None else fit.score(second)
        written += _write(fit, out, second, score)
        # The result is complete: remove the file of an interrupted search.
        (out / _partial(kind)).unlink(missing_ok=True)
        printed.append(fit.summary())
        if second is not None and score is not None:
            own = ", with an offset of its own" if offset else ""
            span = f"from {second.t[0]:.6g} to {second.t[-1]:.6g} s"
            printed.append(f"on {second.source} {span}, not fitted{own}: {score}")
            printed += [f"note  {note}" for note in score.notes]
    print("\n\n".join(printed))
    list_files(written)


def _kinds(given: list[str] | None) -> list[str]:
    """Check the names of the models before the first is identified."""
    from ..identification.selection import AUTO
    from ..stages.registry import model_named

    kinds = given or [AUTO]
    for i, name in enumerate(kinds):
        if name != AUTO:
            model_named(name)
        if name in kinds[:i]:
            raise ParameterError(f"--model names {name} twice: expected it once")
    return kinds


def _searched(name: str) -> bool:
    """Whether a swarm searches the model, or one of those that are tried."""
    from ..identification.selection import AUTO
    from ..stages.registry import model_named

    return name == AUTO or model_named(name).searched


def _of_model(name: str, names: list[str], arguments: dict[str, Any]) -> dict[str, Any]:
    """Leave out the effort of a search where another of the models named is searched."""
    if _searched(name) or not any(_searched(one) for one in names):
        return arguments
    return {key: arguments[key] for key in arguments if key not in ("seed", "runs", "threads")}


def _partial(model: str) -> str:
    """Name of the file that an interrupted search leaves."""
    return f"{model}.partial.json"


def _search(log: Dataset, out: Path, kind: str, **arguments: Any) -> Identification:
    """Identify; on Ctrl-C save the best model found so far."""
    from .._support.files import make_folder
    from ..identification.fit import identify

    try:
        return identify(log, kind, **arguments)
    except Interrupted as stopped:
        heard()
        if stopped.partial is None:
            raise
        path = stopped.partial.save(make_folder(out) / _partial(kind))
        raise KeyboardInterrupt(f"{stopped}; the best so far is in {path}") from None


def _write(
    fit: Identification, out: Path, second: Dataset | None, score: Score | None
) -> list[Path]:
    """Write the model, with its validation on a second log, and the pictures."""
    from .._support.files import make_folder, save_figures, together
    from ..identification.plot import plot_loop, plot_time
    from ..identification.report import save_identification

    kind = fit.model.info
    figures = {}
    if second is not None and score is not None:
        judged = {
            "source": second.source,
            "sha256": second.sha256,
            "window_s": [float(second.t[0]), float(second.t[-1])],
            "rms": {"value": score.rms, "unit": "m"},
            "max_error": {"value": score.max_error, "unit": "m"},
            "offset": {"value": score.offset, "unit": "m"},
        }
        fit = replace(fit, details={**fit.details, "validation": judged})
        run = fit.simulate(second)
        figures = {
            f"{kind.name}_validation_loop": plot_loop(second, run).figure,
            f"{kind.name}_validation_time": plot_time(second, run, stroke=fit.stroke)[0].figure,
        }
    with together(make_folder(out)) as folder:
        written = save_identification(fit, folder)
        written += save_figures(figures, folder)  # type: ignore[arg-type]
    return written


def _swarm(name: str | None) -> ParticleSwarm | None:
    from ..identification.swarm import ParticleSwarm

    known = {
        "default": None,
        "xu-li-2010": ParticleSwarm.xu_li_2010(),
        "spso-2011": ParticleSwarm.spso_2011(),
    }
    if name is None:
        return None
    if name not in known:
        raise ParameterError(f"--swarm is '{name}': expected {', '.join(known)}")
    return known[name]


def _delay(text: str | None) -> bool | float | tuple[float, float] | None:
    if text is None or text == "fit":
        return None if text is None else True
    return number_range("--delay", text) if ":" in text else number("--delay", text)


def _creep(text: str | None) -> bool | list[float] | None:
    if text is None or text == "fit":
        return None if text is None else True
    return [number("--creep", part) for part in text.split(",")]
