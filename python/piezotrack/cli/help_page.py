"""Pages of ``--help``: options under headings, as wide as the terminal."""

from __future__ import annotations

import os
import shutil
import sys
import textwrap
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable

    import click

__all__ = ["coloured_help", "help_page", "list_page"]

# Columns of a page at most, and of its left part.
WIDEST, LEFT = 100, 24
BOLD, CYAN, PLAIN = "\033[1m", "\033[36m", "\033[0m"


def coloured_help(option: click.Option | None) -> click.Option | None:
    """Let an option ``--help`` print in colour on a terminal that has it."""
    if option is not None:
        option.callback, option.help = _print_help, "Print this help"
    return option


def _print_help(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    """Print the help of a command, and end it."""
    del param
    if not value or ctx.resilient_parsing:
        return
    page = ctx.get_help()
    if sys.stdout.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb":
        # The stream of the command shows escapes as text.
        stream = getattr(sys.stdout, "unescaped", sys.stdout)
        print("\n".join(map(_coloured, page.split("\n"))), file=stream)
    else:
        print(page)
    ctx.exit()


def _coloured(line: str) -> str:
    """Make headings bold and names coloured."""
    if line and not line.startswith(" ") and line.endswith(":"):
        return f"{BOLD}{line}{PLAIN}"
    if line.startswith("  ") and not line.startswith("   "):
        name, gap, text = line[2:].partition("  ")
        return f"  {CYAN}{name}{PLAIN}{gap}{text}"
    return line


def help_page(command: Any, ctx: click.Context) -> str:
    """Write the help of a command."""
    parts = [f"Usage: {ctx.command_path} {' '.join(command.collect_usage_pieces(ctx))}"]
    parts = [textwrap.fill(parts[0], _width(), subsequent_indent="    ")]
    for paragraph in (command.help or "").split("\n\n"):
        parts.append(textwrap.fill(" ".join(paragraph.split()), _width()))
    sections: dict[str, list[tuple[str, str]]] = {}
    for param in command.get_params(ctx):
        is_argument = param.param_type_name == "argument"
        title = "Arguments" if is_argument else command.titles.get(param.name or "", "Options")
        name = (
            param.make_metavar(ctx).strip("[]").replace(" [", " ")
            if is_argument
            else _name(param, ctx)
        )
        text = param.help or ""
        if not is_argument and param.required:
            text += "; required"
        if param.param_type_name == "option" and param.name == "rate" and _merged(sections, title):
            continue
        sections.setdefault(title, []).append((name, text))
    # Options without a group stand before the groups, --help last.
    options = sections.pop("Options", [])
    ends = [one for one in options if one[0] == "--help"]
    ordered = {
        "Arguments": sections.pop("Arguments", []),
        "Options": [one for one in options if one not in ends],
        "Output": [],
        **sections,
    }
    last = "Output" if ordered["Output"] else "Options"
    ordered[last] = [*ordered[last], *ends]
    ordered["Output"] = ordered.pop("Output")
    for title, rows in ordered.items():
        if rows:
            parts.append(f"{title}:\n{_table(rows)}")
    return "\n\n".join(parts)


def list_page(
    usage: str, sentence: str, sections: dict[str, list[tuple[str, str]]], end: str
) -> str:
    """Write a list of commands under headings."""
    tables = [f"{title.capitalize()}:\n{_table(rows)}" for title, rows in sections.items() if rows]
    return "\n\n".join([usage, textwrap.fill(sentence, _width()), *tables, end])


def _merged(sections: dict[str, list[tuple[str, str]]], title: str) -> bool:
    """Put ``--rate`` on the line of ``--dt``."""
    for i, (name, text) in enumerate(sections.get(title, [])):
        if name.startswith("--dt "):
            sections[title][i] = (f"{name}, --rate FREQUENCY", text)
            return True
    return False


def _name(param: Any, ctx: click.Context) -> str:
    """Write the names of an option and the metavar of its value."""
    names = ", ".join([*param.opts, *param.secondary_opts]).replace(", --no-", "/--no-")
    if param.is_flag:
        return names
    metavar = param.metavar or param.type.get_metavar(param, ctx) or param.type.name.upper()
    return f"{names} {metavar}"


def _table(rows: Iterable[tuple[str, str]]) -> str:
    """Write two columns; a name too long for the left one has a line of its own."""
    width = _width()
    # The narrowest column in which most names fit.
    lengths = sorted(len(name) for name, _ in rows)
    left = min(max(lengths), LEFT, width // 2) + 4
    lines = []
    for name, text in rows:
        words = textwrap.wrap(text, max(width - left, 20), break_on_hyphens=False)
        head = f"  {name}"
        if len(head) > left - 2:
            # On the same line, where all of it fits.
            if len(head) + 2 + len(text) <= width:
                lines.append(f"{head}  {text}")
                continue
            lines.append(head)
        else:
            first = words.pop(0) if words else ""
            lines.append(f"{head:<{left}}{first}".rstrip())
        lines += [" " * left + word for word in words]
    return "\n".join(lines)


def _width() -> int:
    return min(max(shutil.get_terminal_size((80, 24)).columns, 40), WIDEST)
