"""Write docs/reference: every command with its options, every public name with its parameters.

Run as ``make reference``, or ``python docs/make_reference.py`` where the package is installed; a
test compares the pages with what this would write.
"""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
import types
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import typer

import piezotrack as pt
from piezotrack.cli.commands import app

__all__ = ["FOLDER", "pages"]

FOLDER = Path(__file__).parent / "reference"
HEAD = "<!-- Made by docs/make_reference.py: do not edit, run `make reference`. -->\n\n"
# In the order in which they are used.
ROOMS = (
    *(pt.data, pt.identification, pt.stages, pt.references, pt.hardware, pt.control),
    pt.xu_li_2010,
)


class Doc(NamedTuple):
    """Docstring: its first paragraph, and the named entries of each numpydoc section."""

    summary: str
    sections: dict[str, list[tuple[str, str]]]


def pages() -> dict[str, str]:
    """Return the text of every page, by its name in docs/reference."""
    found = {"commands.md": _commands(), "index.md": _index()}
    for room in ROOMS:
        found[f"{_short(room)}.md"] = _room(room)
    return found


# Commands.


def _commands() -> str:
    group: Any = typer.main.get_command(app)
    lines = ["# Commands\n", "`piezotrack COMMAND --help` prints the same.\n"]
    lines += ["| command | |", "| --- | --- |"]
    lines += [
        f"| [{name}](#{name}) | {_first(command.help)} |"
        for name, command in group.commands.items()
    ]
    for name, command in group.commands.items():
        lines += _command(name, command)
    return HEAD + "\n".join(lines) + "\n"


def _command(name: str, command: Any) -> list[str]:
    context = command.context_class(command, info_name=f"piezotrack {name}")
    usage = command.get_usage(context).removeprefix("Usage: ").replace("{", "").replace("}", "")
    lines = [f"\n## {name}\n", f"    {' '.join(usage.split())}\n", f"{command.help}\n"]
    lines += ["| | | default |", "| --- | --- | --- |"]
    for parameter in command.get_params(context):
        written, text = parameter.get_help_record(context)
        if written == "--help":
            continue
        text, _, extra = text.partition("  [")
        default = extra.rstrip("]").removeprefix("default: ")
        lines.append(f"| `{_cell(written)}` | {_cell(text)} | {_cell(default)} |")
    return lines


# Python.


def _index() -> str:
    lines = [
        "# Python\n",
        "`import piezotrack as pt`. The names below are at the top; all others are in the packages"
        " `pt.data`, `pt.identification` and so on. `help(pt.identify)` has the whole text with an"
        " example.\n",
        "| package | what it has |",
        "| --- | --- |",
    ]
    lines += [
        f"| [{room.__name__.replace('piezotrack', 'pt')}]({_short(room)}.md) | "
        f"{_first(room.__doc__)} |"
        for room in ROOMS
    ]
    lines += ["\n## Names at the top\n", "| name | |", "| --- | --- |"]
    errors = []
    for name in _names(pt):
        value = getattr(pt, name)
        if inspect.isclass(value) and issubclass(value, BaseException):
            errors.append(f"| `pt.{name}` | {_first(inspect.getdoc(value))} |")
            continue
        home = next((room for room in ROOMS if name in _names(room)), None)
        if home is None:
            continue
        shown, anchor = f"pt.{name}", _anchor(_title(home, name))
        lines.append(f"| [{shown}]({_short(home)}.md#{anchor}) | {_first(inspect.getdoc(value))} |")
    lines += ["\n## Exceptions\n", "| name | |", "| --- | --- |", *errors]
    return HEAD + "\n".join(lines) + "\n"


def _room(room: types.ModuleType) -> str:
    lines = [f"# pt.{_short(room)}\n", f"{_first(room.__doc__)} [All packages](index.md)\n"]
    for name in _names(room):
        value = getattr(room, name)
        if inspect.ismodule(value):
            lines += [f"\n## {_title(room, name)}\n", f"{_first(value.__doc__)}"]
            for inner in _names(value):
                lines += _entry(f"pt.datasets.{inner}", getattr(value, inner))
        elif isinstance(value, types.UnionType):
            kinds = ", ".join(f"`{kind.__name__}`" for kind in value.__args__)
            lines += [f"\n## {_title(room, name)}\n", f"One of {kinds}."]
        else:
            lines += _entry(_title(room, name), value)
    return HEAD + "\n".join(lines) + "\n"


def _entry(title: str, value: Any) -> list[str]:
    """One function or class; of a class also its methods and properties."""
    found = _read(inspect.getdoc(value) or "")
    lines = [f"\n## {title}\n"]
    # What has attributes is a result, and not made by hand.
    if "Attributes" not in found.sections:
        lines.append(f"```py\n{_wrapped(_call(title, value))}\n```\n")
    lines.append(f"{found.summary}\n")
    for section in ("Parameters", "Attributes", "Returns"):
        entries = found.sections.get(section, [])
        if not entries:
            continue
        if section == "Returns":
            lines += [
                f"Returns {kind}: {text}" if text else f"Returns {kind}" for kind, text in entries
            ]
            continue
        lines += [f"| {section.lower()} | |", "| --- | --- |"]
        lines += [f"| `{name}` | {text} |" for name, text in entries]
        lines.append("")
    if inspect.isclass(value) and (rows := _members(value, set(_documented(found)))):
        lines += ["| | |", "| --- | --- |", *rows]
    return lines


def _members(owner: type, fields: set[str]) -> list[str]:
    rows = []
    for name, member in inspect.getmembers(owner):
        home = inspect.unwrap(getattr(member, "fget", None) or getattr(member, "func", member))
        if name.startswith("_") or name in fields:
            continue
        if not str(getattr(home, "__module__", "")).startswith("piezotrack"):
            continue
        text = _first(inspect.getdoc(member))
        shown = (
            _call(name, member) if inspect.isfunction(member) or inspect.ismethod(member) else name
        )
        rows.append(f"| `{shown}` | {text} |")
    return rows


def _call(name: str, value: Any) -> str:
    """Write a call with its defaults, without types."""
    given = [
        one.replace(annotation=inspect.Parameter.empty)
        for one in inspect.signature(value).parameters.values()
        if one.name not in ("self", "cls")
    ]
    # In the quotes of a formatter.
    return f"{name}{inspect.Signature(given)}".replace("'", '"')


def _wrapped(call: str) -> str:
    return textwrap.fill(call, 96, subsequent_indent="    ", break_on_hyphens=False)


def _read(text: str) -> Doc:
    """Split a numpydoc docstring."""
    lines = text.splitlines()
    heads = [
        i
        for i, line in enumerate(lines[:-1])
        if line and set(lines[i + 1]) == {"-"} and len(lines[i + 1]) >= 3
    ]
    sections = {}
    for start, stop in pairwise([*heads, len(lines)]):
        sections[lines[start]] = _entries(lines[start + 2 : stop])
    return Doc(_first(text), sections)


def _entries(lines: list[str]) -> list[tuple[str, str]]:
    """Names with their types, each with its text in one line."""
    entries: list[tuple[str, list[str]]] = []
    for line in lines:
        if line and not line.startswith(" "):
            entries.append((line, []))
        elif entries:
            entries[-1][1].append(line.strip())
    return [(_cell(name), _cell(" ".join(text).strip())) for name, text in entries]


def _documented(found: Doc) -> list[str]:
    return [
        name.strip()
        for section in ("Parameters", "Attributes")
        for entry, _ in found.sections.get(section, [])
        for name in entry.partition(" : ")[0].split(",")
    ]


def _names(room: types.ModuleType) -> list[str]:
    """Names that the stub of a package exports, or its own list."""
    assert room.__file__ is not None
    stub = Path(room.__file__).with_suffix(".pyi")
    if not stub.exists():
        return sorted(vars(room)["__all__"])
    found = [
        imported.name
        for line in ast.parse(stub.read_text(encoding="utf-8")).body
        if isinstance(line, ast.ImportFrom)
        for imported in line.names
    ]
    # Functions first: they are what is called.
    return sorted(found, key=lambda name: (not name[0].islower(), name.lower()))


def _title(room: types.ModuleType, name: str) -> str:
    return f"pt.{name}" if name in _names(pt) else f"pt.{_short(room)}.{name}"


def _short(room: types.ModuleType) -> str:
    return room.__name__.rpartition(".")[2]


def _anchor(title: str) -> str:
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def _first(text: str | None) -> str:
    """First paragraph, in one line."""
    return _cell(" ".join((text or "").strip().partition("\n\n")[0].split()))


def _cell(text: str) -> str:
    """Text of a table: one line, without what would end the cell."""
    return text.replace("``", "`").replace("|", "\\|")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for file, content in pages().items():
        (FOLDER / file).write_text(content, encoding="utf-8")
        print(FOLDER / file)
