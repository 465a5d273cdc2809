"""The commands of ``piezotrack`` by heading, each imported when it is called."""

from __future__ import annotations

import sys
from importlib import import_module
from typing import Any

import click

from .. import __version__
from ..errors import PiezotrackError
from .command import command
from .error_messages import of_the_system, say
from .help_page import coloured_help, list_page
from .values import named, nearest

__all__ = ["COMMANDS", "app", "run"]

# The heading is the folder of the command.
HEADINGS = {
    "data": ("info", "convert", "noise"),
    "identify": ("identify", "compare", "step", "campaign", "watch", "suggest"),
    "control": ("simulate", "feedforward", "track", "tune", "verify", "learn", "contour", "export"),
    "device": ("measure", "response", "play", "serve"),
    "app": ("app",),
    "installation": ("doctor",),
    "research": ("demo", "compare-controllers", "benchmark", "reproduce"),
}
COMMANDS = {name: heading for heading, names in HEADINGS.items() for name in names}
# Entry points of other packages: a command of click, or a function as `command` takes it.
GROUP = "piezotrack.commands"
END = """\
`piezotrack demo` shows an identification and a loop; `piezotrack COMMAND --help` shows the options
of a command. Values have units: 20ms, 1kHz, 65nm, 0:75V, 3s:15s. Completion of words:
  eval "$(_PIEZOTRACK_COMPLETE=bash_source piezotrack)"    (or zsh_source, fish_source)"""


class Commands(click.Group):
    """The commands of the package, and those that other packages declare."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names, those of other packages last."""
        del ctx
        return [*COMMANDS, *sorted(_others() - set(COMMANDS))]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command; one of the package is never replaced."""
        del ctx
        if cmd_name in self.commands:
            return self.commands[cmd_name]
        name = cmd_name.replace("-", "_")
        if cmd_name in COMMANDS:
            module = import_module(f".{COMMANDS[cmd_name]}.{name}", __package__)
            found: click.Command = getattr(module, f"{name}_command")
        elif cmd_name in _others():
            from importlib.metadata import entry_points

            (entry,) = entry_points(group=GROUP, name=cmd_name)
            loaded = entry.load()
            found = loaded if isinstance(loaded, click.Command) else command()(loaded)
        else:
            return None
        found.name = cmd_name
        if cmd_name in COMMANDS:
            self.commands[cmd_name] = found
        return found

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command of the arguments."""
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            near = nearest(args[0], self.list_commands(ctx))
            raise click.UsageError(f"there is no command '{args[0]}'{near}", ctx)
        return super().resolve_command(ctx, args)

    def get_help(self, ctx: click.Context) -> str:
        """Return the list of all commands as plain text."""
        names = self.list_commands(ctx)
        sections: dict[str, list[tuple[str, str]]] = {title: [] for title in HEADINGS}
        for name in names:
            one = self.get_command(ctx, name)
            title = COMMANDS.get(name, "other packages")
            sections.setdefault(title, []).append((name, (one and one.short_help) or ""))
        usage = "Usage: piezotrack [--version] [--help] COMMAND ..."
        return list_page(usage, self.help or "", sections, END)

    def get_help_option(self, ctx: click.Context) -> click.Option | None:
        """Return ``--help``, which prints in colour where the terminal has it."""
        return coloured_help(super().get_help_option(ctx))

    def main(self, *args: Any, **extra: Any) -> Any:
        """Run; what is typed wrongly is answered by one sentence."""
        extra["standalone_mode"] = False
        try:
            code = super().main(*args, **extra)
        except click.exceptions.NoArgsIsHelpError as error:
            print(error.ctx.get_help())
            code = 2
        except click.UsageError as error:
            say(_sentence(error))
            code = 2
        except PiezotrackError as error:
            say(str(error))
            code = 2
        raise SystemExit(code if isinstance(code, int) else 0)


def _others() -> set[str]:
    from importlib.metadata import entry_points

    return set(entry_points(group=GROUP).names)


def _sentence(error: click.UsageError) -> str:
    """Write an error of click as those of the library are."""
    where = f"; see {error.ctx.command_path} --help" if error.ctx else ""
    if isinstance(error, click.NoSuchOption):
        names = (
            [name for one in error.ctx.command.params for name in one.opts if name[0] == "-"]
            if error.ctx
            else []
        )
        near = nearest(error.option_name, names)
        return f"there is no option {error.option_name}{near or where}"
    if isinstance(error, click.MissingParameter) and error.param is not None:
        is_option = error.param.param_type_name == "option"
        name = error.param.opts[0] if is_option else named(error.param)
        return f"{name} is missing: expected {_first(error.param)}{where}"
    message = error.format_message().rstrip(".")
    return f"{message[:1].lower()}{message[1:]}{'' if 'did you mean' in message else where}"


def _first(param: Any) -> str:
    text = (param.help or "a value").partition(";")[0].partition(". ")[0]
    return text[:1].lower() + text[1:] if not text[:2].isupper() else text


def _version(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    del param
    if value and not ctx.resilient_parsing:
        print(f"piezotrack {__version__}")
        ctx.exit()


app = Commands(
    "piezotrack",
    help="From a log of a piezo nanopositioner to a model of its hysteresis, and to control.",
    no_args_is_help=True,
    params=[
        click.Option(
            ["--version"],
            is_flag=True,
            is_eager=True,
            expose_value=False,
            callback=_version,
            help="Print the version.",
        )
    ],
)


def run() -> None:
    """Run the command with the arguments of the process."""
    try:
        try:
            app(prog_name="piezotrack")
        finally:
            sys.stdout.flush()
    except OSError as error:
        # The help or the version cannot be printed.
        raise SystemExit(of_the_system(error)) from None
