"""The commands of ``piezotrack``, and the options of ``piezotrack`` itself."""

from __future__ import annotations

import sys
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Annotated, Any

import matplotlib as mpl
import typer
from typer.core import TyperCommand, TyperGroup

from .. import __version__
from .control.contour import contour_command
from .control.export import export_command
from .control.learn import learn_command
from .control.simulate import simulate_command
from .control.track import feedforward_command, track_command
from .control.tune import tune_command
from .data.convert import convert_command
from .data.info import info_command
from .data.noise import noise_command
from .device.measure import measure_command
from .device.play import play_command
from .device.serve import serve_command
from .error_messages import of_the_system
from .identify.campaign import campaign_command
from .identify.compare import compare_command
from .identify.identify import identify_command
from .identify.step import step_command
from .identify.suggest import suggest_command
from .identify.watch import watch_command
from .research.benchmark import benchmark_command
from .research.compare_controllers import compare_controllers_command
from .research.demo import demo_command
from .research.reproduce import reproduce_command

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["app", "run"]

# No window is ever opened.
mpl.use("Agg")

# Entry points of other packages: functions with options of Typer, as the commands here.
GROUP = "piezotrack.commands"


class Commands(TyperGroup):
    """The commands of the package, and those that other packages declare."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names, those of other packages last."""
        own = super().list_commands(ctx)
        return [*own, *sorted(entry_points(group=GROUP).names - set(own))]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command; one of the package is never replaced."""
        if (own := super().get_command(ctx, cmd_name)) is not None:
            return own
        for entry in entry_points(group=GROUP, name=cmd_name):
            other = typer.Typer(rich_markup_mode=None, pretty_exceptions_enable=False)
            other.command(cmd_name, cls=Command)(entry.load())
            return typer.main.get_command(other)
        return None


app = typer.Typer(
    cls=Commands,
    help="Hysteresis identification and tracking control of piezo nanopositioners.",
    no_args_is_help=True,
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


class Command(TyperCommand):
    """A command whose usage shows the names of its arguments as its help does."""

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Write FILE and [MODEL] in place of {FILE} and [[MODEL]]."""
        pieces = super().collect_usage_pieces(ctx)
        table = {"{": "", "}": "", "[[": "[", "]]": "]"}
        for typed, shown in table.items():
            pieces = [piece.replace(typed, shown) for piece in pieces]
        return pieces


COMMANDS: dict[str, Callable[..., None]] = {
    "measure": measure_command,
    "info": info_command,
    "convert": convert_command,
    "identify": identify_command,
    "compare": compare_command,
    "benchmark": benchmark_command,
    "campaign": campaign_command,
    "watch": watch_command,
    "suggest": suggest_command,
    "step": step_command,
    "simulate": simulate_command,
    "feedforward": feedforward_command,
    "track": track_command,
    "play": play_command,
    "tune": tune_command,
    "export": export_command,
    "learn": learn_command,
    "compare-controllers": compare_controllers_command,
    "contour": contour_command,
    "noise": noise_command,
    "serve": serve_command,
    "reproduce": reproduce_command,
    "demo": demo_command,
}
for name, command in COMMANDS.items():
    app.command(name, cls=Command)(command)
