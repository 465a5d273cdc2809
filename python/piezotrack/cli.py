"""The command ``piezotrack``."""

from __future__ import annotations

import io
import os
import re
import sys
from contextlib import contextmanager
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, ParamSpec

import typer

from . import __version__
from .errors import Interrupted, ParameterError, PiezotrackError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from .dataset import Dataset, Hold
    from .identification import Identification
    from .modelfile import Score
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
NOT_PRINTED = 1


P = ParamSpec("P")


def in_words(command: Callable[P, None]) -> Callable[P, None]:
    """Turn what piezotrack raises into one sentence and an exit code."""

    @wraps(command)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        try:
            command(*args, **kwargs)
            sys.stdout.flush()
        except PiezotrackError as error:
            print(f"piezotrack: {_as_options(str(error))}", file=sys.stderr)
            raise typer.Exit(BAD_INPUT) from None
        except KeyboardInterrupt as error:
            print(f"piezotrack: {str(error) or 'interrupted'}", file=sys.stderr)
            raise typer.Exit(INTERRUPTED) from None
        except OSError as error:
            # What there is to keep has been written before anything is printed.
            if not isinstance(error, BrokenPipeError):
                print(f"piezotrack: cannot print: {error.strerror}", file=sys.stderr)
            # The rest of the output is given up, or Python would complain at its end.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(NOT_PRINTED) from None

    return run


# Advice that the library gives in Python, and what to type instead.
ADVICE = [
    (
        re.compile(r"time=0, drive=1, displacement=2, units=\{0: 's', 1: 'V', 2: 'um'\}"),
        "--time 0 --drive 1 --displacement 2 --unit 0=s --unit 1=V --unit 2=um",
    ),
    (re.compile(r"units=\{'?(\w+)'?: \.\.\.\}"), r"--unit \1=..."),
    (re.compile(r"\bfixed="), "--fix"),
    (re.compile(r"\b(time|drive|displacement|dt|stiffness|runs)=(?!\d)"), r"--\1"),
]


def _as_options(sentence: str) -> str:
    for python, option in ADVICE:
        sentence = python.sub(option, sentence)
    return sentence


def main() -> None:
    """Run the command with the arguments of the process."""
    import matplotlib as mpl

    # No window is ever opened, so none is needed.
    mpl.use("Agg")
    # The name of a file may have letters that the terminal has not.
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
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
    columns = _Columns(time, drive, displacement, unit, dt)
    if validate is None and validate_window is not None:
        raise ParameterError("--validate-window is given without --validate")
    log = _windowed(columns.read(file, hold), file, "--window", window)
    second = None
    if validate is not None:
        whole = columns.read(validate, hold)
        second = _windowed(whole, validate, "--validate-window", validate_window)
    _can_be_folder(out)
    arguments = {
        "model": model,
        "free": None if free is None else [name.strip() for name in free.split(",")],
        "fixed": {name: _number("--fix", text) for name, text in _pairs("--fix", fix)},
        "bounds": {name: _range("--bound", text) for name, text in _pairs("--bound", bound)},
        "stiffness": stiffness,
        "offset": offset,
        "swarm": _swarm(swarm),
        "seed": seed,
        "runs": runs,
        "threads": threads,
    }
    with _of_file(file):
        fit = _search(log, out, **arguments)
    score = None if second is None else fit.score(second)
    written = _write(fit, out, second, score)
    print(fit.summary())
    if second is not None and score is not None:
        own = ", with an offset of its own" if offset else ""
        first, last = second.t[0], second.t[-1]
        print(f"\non {second.source} from {first:.6g} to {last:.6g} s, not fitted{own}: {score}")
    _list(written)


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
    from .files import write_columns
    from .io import read_drive
    from .modelfile import load
    from .plotting import plot_response
    from .report import make_folder, save_figures

    known = load(model)
    columns = _Columns(time, drive, None, unit, dt)
    t, u = read_drive(
        drive_file, time=columns.time, drive=columns.drive, units=columns.units, dt=dt
    )
    _can_be_folder(out)
    with _of_file(drive_file):
        run = known.model.simulate(u, float(t[-1] - t[0]) / (t.size - 1), hold=hold)
    x = run.x + known.offset
    folder = make_folder(out)
    table = {"time_s": t, "voltage_V": u, "displacement_um": 1e6 * x}
    written = [write_columns(folder / "simulated.csv", table)]
    written += save_figures({"simulated": plot_response(t, u, x)}, folder)
    print(
        f"{t.size} samples from rest, drive from {u.min():.4g} to {u.max():.4g} V: displacement "
        f"from {1e6 * x.min():.4g} to {1e6 * x.max():.4g} um"
    )
    if fitted := known.drive_range:
        margin = 0.01 * (fitted[1] - fitted[0])
        if u.min() < fitted[0] - margin or u.max() > fitted[1] + margin:
            print(f"note  the model was fitted from {fitted[0]:.4g} to {fitted[1]:.4g} V only")
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

    log = demo_log(seed)
    _can_be_folder(out)
    fit = identify_demo(log, seed=seed)
    rest = fit.score(log.full[fit.data.t[-1] :], offset=fit.offset)
    folder = make_folder(out)
    written = [write_log(log, folder / "log.csv"), *save_identification(fit, folder, shown=log)]
    print("A stage with second-order Dahl hysteresis, driven 12 s with 0.25 Hz, 0 to 75 V.")
    print("Mass, damping, stiffness and piezo coefficient are searched on the first 4 s;")
    print("the hysteresis is held, and with it the scale of the forces.\n")
    print(fit.summary())
    print(f"\nthe other 8 s, not fitted: {rest}")
    _compare(fit)
    _list(written)


class _Columns:
    """The columns of a log as options name them; a number counts them from 0."""

    def __init__(
        self,
        time: str | None,
        drive: str | None,
        displacement: str | None,
        unit: list[str] | None,
        dt: float | None,
    ) -> None:
        self.time, self.drive, self.displacement = map(_column, (time, drive, displacement))
        self.units = {_column(name) or name: text for name, text in _pairs("--unit", unit)}
        self.dt = dt

    def read(self, file: Path, hold: Hold) -> Dataset:
        from .io import read

        return read(
            file,
            time=self.time,
            drive=self.drive,
            displacement=self.displacement,
            units=self.units,
            dt=self.dt,
            hold=hold,
        )


def _column(text: str | None) -> str | int | None:
    return int(text) if text is not None and text.isdecimal() else text


@contextmanager
def _of_file(file: Path) -> Iterator[None]:
    """Say which file an error is about."""
    try:
        yield
    except PiezotrackError as error:
        raise type(error)(f"{file.name}: {error}") from None


def _can_be_folder(out: Path) -> None:
    """Refuse a folder that cannot be written to, before a search and not after it."""
    there = out
    while not there.exists() and there != there.parent:
        there = there.parent
    if not there.is_dir():
        raise ParameterError(f"--out: {out} cannot be made a folder: {there} is a file")
    if not os.access(there, os.W_OK | os.X_OK):
        raise ParameterError(f"--out: {there} cannot be written to: permission denied")


def _windowed(log: Dataset, file: Path, option: str, window: str | None) -> Dataset:
    if window is None:
        return log
    start, colon, stop = window.partition(":")
    if not colon:
        raise ParameterError(f"{option} is '{window}': expected A:B in seconds, as 3:23")
    bounds = [_number(option, text) if text else None for text in (start, stop)]
    try:
        return log[bounds[0] : bounds[1]]
    except ParameterError as error:
        raise ParameterError(f"{file.name}: {option} {window}: {error}") from None


PARTIAL = "dahl.partial.json"


def _search(log: Dataset, out: Path, **arguments: Any) -> Identification:
    """Identify; on Ctrl-C keep the best so far as a file."""
    from .identification import identify
    from .report import make_folder

    try:
        return identify(log, **arguments)
    except Interrupted as stopped:
        if stopped.partial is None:
            raise
        path = stopped.partial.save(make_folder(out) / PARTIAL)
        raise KeyboardInterrupt(f"{stopped}; the best so far is in {path}") from None


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


def _write(
    fit: Identification, out: Path, second: Dataset | None, score: Score | None
) -> list[Path]:
    """Write the model, with what it is worth on a second log, and the pictures."""
    from .plotting import plot_loop, plot_time
    from .report import save_figures, save_identification

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
    (out / PARTIAL).unlink(missing_ok=True)
    return written


def _list(written: Iterable[Path]) -> None:
    print("\nwritten")
    for path in written:
        print(f"  {path}")


def _swarm(name: str) -> ParticleSwarm | None:
    from .swarm import ParticleSwarm

    known = {
        "default": None,
        "xu-li-2010": ParticleSwarm.xu_li_2010(),
        "spso-2011": ParticleSwarm.spso_2011(),
    }
    if name not in known:
        raise ParameterError(f"--swarm is '{name}': expected {', '.join(known)}")
    return known[name]


def _pairs(option: str, given: list[str] | None) -> list[tuple[str, str]]:
    pairs: list[tuple[str, str]] = []
    for text in given or []:
        name, equals, value = text.partition("=")
        if not equals or not name or not value:
            raise ParameterError(f"{option} is '{text}': expected NAME=VALUE")
        if name.strip() in dict(pairs):
            raise ParameterError(f"{option} names {name.strip()} twice: expected it once")
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
