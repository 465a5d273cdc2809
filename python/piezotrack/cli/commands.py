"""The commands of ``piezotrack``, and the options of ``piezotrack`` itself."""

from __future__ import annotations

import sys
from typing import Annotated

import matplotlib as mpl
import typer

from .. import __version__
from .compare import compare_command
from .contour import contour_command
from .demo import demo_command
from .error_messages import of_the_system
from .identify import identify_command
from .noise import noise_command
from .reproduce import reproduce_command
from .simulate import simulate_command
from .step import step_command
from .track import feedforward_command, track_command

__all__ = ["app", "run"]

# No window is ever opened.
mpl.use("Agg")

app = typer.Typer(
    help="Hysteresis identification and tracking control of piezo nanopositioners.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def run() -> None:
    """Run the command with the arguments of the process."""
    try:
        try:
            app()
        finally:
            sys.stdout.flush()
    except OSError as error:
        # The help or the version cannot be printed.
        raise SystemExit(of_the_system(error)) from None


def _version(requested: bool) -> None:
    if requested:
        print(f"piezotrack {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Declare the options of the command itself."""


app.command("identify")(identify_command)
app.command("compare")(compare_command)
app.command("step")(step_command)
app.command("simulate")(simulate_command)
app.command("feedforward")(feedforward_command)
app.command("track")(track_command)
app.command("contour")(contour_command)
app.command("noise")(noise_command)
app.command("reproduce")(reproduce_command)
app.command("demo")(demo_command)
