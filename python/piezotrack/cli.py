"""The command ``piezotrack``."""

from __future__ import annotations

import sys
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, ParamSpec

import typer

from . import __version__
from .errors import Interrupted, ParameterError, PiezotrackError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from .dataset import Dataset, Hold
    from .identification import Identification
    from .swarm import ParticleSwarm

__all__ = ["app", "main"]

app = typer.Typer(
    help="From a log of a piezo nanopositioner to an identified hysteresis model.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

BAD_INPUT = 2
INTERRUPTED = 130


P = ParamSpec("P")


def in_words(command: Callable[P, None]) -> Callable[P, None]:
    """Turn what piezotrack raises into one sentence and an exit code."""

    @wraps(command)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        try:
            command(*args, **kwargs)
        except PiezotrackError as error:
            print(f"piezotrack: {error}", file=sys.stderr)
            raise typer.Exit(BAD_INPUT) from None
        except KeyboardInterrupt as error:
            print(f"piezotrack: {error or 'interrupted'}", file=sys.stderr)
            raise typer.Exit(INTERRUPTED) from None

    return run


def main() -> None:
    """Run the command with the arguments of the process."""
    import matplotlib as mpl

    # No window is ever opened, so none is needed.
    mpl.use("Agg")
    app()


def _version(asked: bool) -> None:
    if asked:
        print(f"piezotrack {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Take the options of the command as such."""


Seconds = Annotated[
    str | None,
    typer.Option(metavar="A:B", help="Seconds that count; the drive before A is warm-up."),
]
TimeColumn = Annotated[str | None, typer.Option(help="Column of the time.")]
DriveColumn = Annotated[str | None, typer.Option(help="Column of the drive voltage.")]
DisplacementColumn = Annotated[str | None, typer.Option(help="Column of the displacement.")]
Units = Annotated[
    list[str] | None,
    typer.Option(
        "--unit",
        metavar="NAME=UNIT",
        help="Unit of a column, or of time, drive, displacement. Repeatable.",
    ),
]
Interval = Annotated[
    float | None, typer.Option(help="Sampling interval in s, in place of a time column.")
]
HoldOption = Annotated[
    Literal["foh", "zoh"],
    typer.Option(help="Between samples the drive is a line (foh) or constant (zoh)."),
]
Out = Annotated[Path, typer.Option(help="Folder for the results.")]


@app.command("identify")
@in_words
def identify_command(
    file: Annotated[Path, typer.Argument(help="Log in CSV, with units in its header.")],
    window: Seconds = None,
    model: Annotated[str, typer.Option(help="Kind of stage: dahl.")] = "dahl",
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
    swarm: Annotated[str, typer.Option(help="Settings: default or xu-li-2010.")] = "default",
    seed: Annotated[int, typer.Option(help="Same seed, same result.")] = 0,
    runs: Annotated[int, typer.Option(help="Swarms that search apart; do they agree?")] = 1,
    threads: Annotated[int | None, typer.Option(help="All cores if not given.")] = None,
    validate: Annotated[
        Path | None, typer.Option(help="A second log, to judge the model on; not fitted.")
    ] = None,
    validate_window: Seconds = None,
) -> None:
    """Identify a stage from a log: a table, a JSON model, pictures."""
    log = _windowed(_read(file, time, drive, displacement, unit, dt, hold), "--window", window)
    second = None
    if validate is not None:
        second = _windowed(
            _read(validate, time, drive, displacement, unit, dt, hold),
            "--validate-window",
            validate_window,
        )
    fit = _search(
        log,
        file.name,
        out,
        model=model,
        free=None if free is None else [name.strip() for name in free.split(",")],
        fixed={name: _number("--fix", text) for name, text in _pairs("--fix", fix)},
        bounds={name: _range("--bound", text) for name, text in _pairs("--bound", bound)},
        stiffness=stiffness,
        offset=offset,
        swarm=_swarm(swarm),
        seed=seed,
        runs=runs,
        threads=threads,
    )
    _show(fit)
    if second is not None:
        print(f"\non {second.source}, not fitted: {fit.score(second)}")
    _write(fit, out, second)


@app.command("simulate")
@in_words
def simulate_command(
    model: Annotated[Path, typer.Argument(help="Model file in JSON.")],
    drive_file: Annotated[
        Path, typer.Argument(metavar="DRIVE", help="CSV with time and drive voltage.")
    ],
    out: Out = Path("results"),
    time: TimeColumn = None,
    drive: DriveColumn = None,
    unit: Units = None,
    dt: Interval = None,
    hold: HoldOption = "foh",
) -> None:
    """Simulate a model under a drive: a CSV with the displacement, and a picture."""
    from .demo import write_columns
    from .io import read_drive
    from .modelfile import load
    from .plotting import plot_response
    from .report import make_folder, save_figures

    known = load(model)
    t, u = read_drive(drive_file, time=time, drive=drive, units=dict(_pairs("--unit", unit)), dt=dt)
    interval = float(t[-1] - t[0]) / (t.size - 1)
    run = known.model.simulate(u, interval, hold=hold)
    folder = make_folder(out)
    columns = {"time_s": t, "voltage_V": u, "displacement_um": 1e6 * (run.x + known.offset)}
    written = [write_columns(folder / "simulated.csv", columns)]
    figure = plot_response(t, u, run.x + known.offset)
    written += save_figures({"simulated": figure}, folder)
    low, high = 1e6 * run.x.min(), 1e6 * run.x.max()
    print(f"{t.size} samples, displacement from {low:.4g} to {high:.4g} um from rest")
    _list(written)


@app.command("demo")
@in_words
def demo_command(
    out: Out = Path("demo"),
    seed: Annotated[int, typer.Option(help="Same seed, same result.")] = 1,
) -> None:
    """Show the way from a log to a model, on a log of a built-in stage."""
    from .demo import demo_log, identify_demo, write_log
    from .report import make_folder, save_identification

    folder = make_folder(out)
    log = demo_log(seed)
    written = [write_log(log, folder / "log.csv")]
    print("A stage with second-order Dahl hysteresis, driven 12 s with 0.25 Hz, 0 to 75 V.")
    print("Mass, damping, stiffness and piezo coefficient are searched on the first 4 s;")
    print("the hysteresis is held, and with it the scale of the forces.\n")
    fit = identify_demo(log, seed=seed)
    _show(fit)
    rest = fit.score(log.full[fit.data.t[-1] :], offset=fit.offset)
    print(f"\nthe other 8 s, not fitted: {rest}")
    _compare(fit)
    written += save_identification(fit, folder, shown=log)
    _list(written)


def _read(
    file: Path,
    time: str | None,
    drive: str | None,
    displacement: str | None,
    unit: list[str] | None,
    dt: float | None,
    hold: Hold,
) -> Dataset:
    from .io import read

    units: dict[str | int, str] = dict(_pairs("--unit", unit))
    return read(
        file,
        time=time,
        drive=drive,
        displacement=displacement,
        units=units,
        dt=dt,
        hold=hold,
    )


def _windowed(log: Dataset, option: str, window: str | None) -> Dataset:
    if window is None:
        return log
    start, colon, stop = window.partition(":")
    if not colon:
        raise ParameterError(f"{option} is '{window}': expected A:B in seconds, as 3:23")
    bounds = [_number(option, text) if text else None for text in (start, stop)]
    return log[bounds[0] : bounds[1]]


def _search(log: Dataset, name: str, out: Path, **arguments: Any) -> Identification:
    """Identify; on Ctrl-C keep the best so far as a file."""
    from .identification import identify
    from .report import make_folder

    folder = make_folder(out)
    try:
        return identify(log, **arguments)
    except Interrupted as stopped:
        if stopped.partial is not None:
            path = stopped.partial.save(folder / "dahl.partial.json")
            raise KeyboardInterrupt(f"{stopped}; the best so far is in {path}") from None
        raise
    except PiezotrackError as error:
        raise type(error)(f"{name}: {error}") from None


def _show(fit: Identification) -> None:
    print(fit.summary())


def _compare(fit: Identification) -> None:
    """Show what the stage of the demonstration really has."""
    from .models import DahlStage

    true = DahlStage.xu_li_2010()
    found = fit.model
    for name, symbol in (("damping", "D"), ("stiffness", "K"), ("piezo_coefficient", "T")):
        share = 100.0 * (getattr(found, name) / getattr(true, name) - 1.0)
        print(
            f"  {symbol} found {getattr(found, name):.6g}, true {getattr(true, name):.6g}: "
            f"{round(share, 3) + 0.0:+.3f} %"
        )


def _write(fit: Identification, out: Path, second: Dataset | None) -> None:
    from .plotting import plot_loop, plot_time
    from .report import save_figures, save_identification

    written = save_identification(fit, out)
    if second is not None:
        run = fit.simulate(second)
        figures = {
            "validation_loop": plot_loop(second, run).figure,
            "validation_time": plot_time(second, run, stroke=fit.stroke)[0].figure,
        }
        written += save_figures(figures, out)  # type: ignore[arg-type]
    _list(written)


def _list(written: Iterable[Path]) -> None:
    print("\nwritten")
    for path in written:
        print(f"  {path}")


def _swarm(name: str) -> ParticleSwarm:
    from .swarm import ParticleSwarm

    known = {"default": ParticleSwarm, "xu-li-2010": ParticleSwarm.xu_li_2010}
    if name not in known:
        raise ParameterError(f"--swarm is '{name}': expected {' or '.join(known)}")
    return known[name]()


def _pairs(option: str, given: list[str] | None) -> list[tuple[str, str]]:
    pairs = []
    for text in given or []:
        name, equals, value = text.partition("=")
        if not equals or not name or not value:
            raise ParameterError(f"{option} is '{text}': expected NAME=VALUE")
        pairs.append((name.strip(), value.strip()))
    return pairs


def _number(option: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ParameterError(f"{option} has '{text}': expected a number") from None


def _range(option: str, text: str) -> tuple[float, float]:
    low, colon, high = text.partition(":")
    if not colon:
        raise ParameterError(f"{option} has '{text}': expected LOW:HIGH")
    return _number(option, low), _number(option, high)
