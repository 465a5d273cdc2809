"""Commands from functions: annotated arguments and groups of options become those of click."""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass
from functools import wraps
from inspect import Parameter, getdoc, signature
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

import click

from ..errors import ParameterError
from .error_messages import report_errors
from .help_page import coloured_help, help_page
from .values import PLAIN, Names, ParamType, Quantity, Whole, named

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

__all__ = ["Argument", "Command", "Option", "command", "given", "group", "refuse_without_effect"]

T = TypeVar("T")


@dataclass_transform(frozen_default=True, kw_only_default=True)
def group(options: type[T]) -> type[T]:
    """Make a group of options of a class: a frozen dataclass of keywords."""
    return dataclass(frozen=True, kw_only=True)(options)


@dataclass(frozen=True)
class Option:
    """Help, type and names of an option, as an annotation.

    Parameters
    ----------
    help : str
        A sentence or two without a full stop; the default is added where it is a value.
    type : click.ParamType, optional
        Of the value; by default that of the annotation.
    metavar : str, optional
        By default that of the type.
    names : tuple of str, optional
        By default that of the argument.
    """

    help: str
    type: ParamType | None = None
    metavar: str | None = None
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Argument:
    """Help and metavar of a positional argument, as an annotation."""

    help: str
    metavar: str
    type: ParamType | None = None


class Command(click.Command):
    """A command whose help is grouped, with a line for each option.

    Attributes
    ----------
    titles : dict of str to str
        Heading of each parameter that has one.
    """

    titles: dict[str, str]

    def get_help(self, ctx: click.Context) -> str:
        """Return the help as plain text."""
        return help_page(self, ctx)

    def get_help_option(self, ctx: click.Context) -> click.Option | None:
        """Return ``--help``, which prints in colour where the terminal has it."""
        return coloured_help(super().get_help_option(ctx))


def command(**defaults: Any) -> Callable[[Callable[..., None]], Command]:
    """Make a command of a function.

    Arguments of a dataclass are groups: their fields become options under the heading of the
    first line of its docstring.
    """

    def made(function: Callable[..., None]) -> Command:
        parameters = signature(function, eval_str=True).parameters.values()
        groups: dict[str, Any] = {
            one.name: one.annotation for one in parameters if is_dataclass(one.annotation)
        }

        @wraps(function)
        def run(**values: Any) -> None:
            for one in params:
                if one.multiple or one.nargs == -1:
                    values[one.name or ""] = list(values[one.name or ""]) or None
            for name, group in groups.items():
                values[name] = group(**{one.name: values.pop(one.name) for one in fields(group)})
            function(**values)

        declared = [each for one in parameters for each in _expanded(one)]
        params = [
            _click(name, hint, defaults.get(name, default)) for name, hint, default, _ in declared
        ]
        text = getdoc(function) or ""
        one = Command(
            None,
            callback=report_errors(run),
            params=params,
            help=text,
            short_help=text.partition("\n")[0],
        )
        one.titles = {name: title for name, _, _, title in declared if title}
        return one

    return made


def _expanded(argument: Parameter) -> Iterator[tuple[str, Any, Any, str]]:
    """Yield name, annotation, default and heading of an argument, or of the fields of a group."""
    group = argument.annotation
    if not is_dataclass(group):
        yield argument.name, group, argument.default, ""
        return
    title = (group.__doc__ or "").partition("\n")[0].rstrip(".")
    hints = get_type_hints(group, include_extras=True)
    for one in fields(group):
        yield one.name, hints[one.name], one.default, title


def _click(name: str, hint: Any, default: Any) -> click.Parameter:
    """Make a parameter of click."""
    said: Any = None
    if get_origin(hint) is Annotated:
        hint, said = get_args(hint)[:2]
    required = default is Parameter.empty
    if said is None:
        said = Argument("", name.upper()) if required else Option("")
    many = False
    parts = [one for one in get_args(hint) if one is not NoneType]
    if get_origin(hint) in (Union, UnionType):
        (hint,) = parts
    if get_origin(hint) is list:
        many, (hint,) = True, get_args(hint)
    kind = said.type or _type(hint)
    # None would be a default.
    options: dict[str, Any] = {"required": True} if required else {"default": default}
    if isinstance(said, Argument):
        return _Argument(
            [name],
            text=said.help,
            metavar=said.metavar,
            type=kind,
            nargs=-1 if many else 1,
            **({"required": False} | options),
        )
    names = said.names or (f"--{name.replace('_', '-')}",)
    if hint is bool:
        if default is not False:
            names = (f"{names[0]}/--no-{names[0].lstrip('-')}", *names[1:])
        return click.Option([name, *names], help=said.help, default=default, is_flag=True)
    text = said.help
    if not (required or many or default is None or "default" in text):
        shown = f"{default:g}" if isinstance(default, float) else default
        unit = kind.bare if isinstance(kind, Quantity) and default else ""
        text += f"; default {'none' if shown == 'inf' else f'{shown} {unit}'.rstrip()}"
    return click.Option(
        [name, *names],
        help=text,
        metavar=said.metavar,
        type=kind,
        multiple=many,
        **options,
    )


class _Argument(click.Argument):
    """A positional argument with a help."""

    def __init__(self, *args: Any, text: str, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.help = text

    def make_metavar(self, ctx: click.Context | None = None) -> str:
        """Return the name, in brackets where it may be left out."""
        del ctx
        name = self.metavar or self.human_readable_name
        shown = f"{name}..." if self.nargs == -1 and not name.endswith("]") else name
        return shown if self.required or name.startswith("[") else f"[{shown}]"


def _type(hint: Any) -> ParamType:
    """Return the type of the values of an annotation."""
    if get_origin(hint) is Literal:
        return Names(get_args(hint))
    if hint is Path:
        return click.Path(path_type=Path)
    if hint is int:
        return Whole()
    if hint is float:
        return PLAIN
    return click.STRING


def given(*names: str) -> list[str]:
    """Return those options of the command at work that were typed, as they are typed."""
    context = click.get_current_context()
    params = {one.name: one for one in context.command.params}
    sources = {name: context.get_parameter_source(name) for name in names}
    return [
        named(params[name])
        for name, source in sources.items()
        if source is not None and source.name != "DEFAULT"
    ]


def refuse_without_effect(
    options: Iterable[str], reason: str, expected: str = "it left out"
) -> None:
    """Refuse options that were given although they have no effect; `reason` says beside what."""
    for option in given(*options):
        raise ParameterError(option, f"no effect {reason}", expected, verb="has")
