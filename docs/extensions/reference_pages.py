"""The reference: a page for each room of public names, from docstrings, and one of the commands.

The pages are written to docs/reference when the site is built; a public name that no page has is a
warning, and warnings end the build.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import os
import re
import types
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

from gallery import SCRIPTS
from sphinx.util import logging

if TYPE_CHECKING:
    from sphinx.application import Sphinx

__all__ = ["ROOMS", "pages", "places", "setup"]

# In the order in which they are used.
ROOMS = (
    "data",
    "identification",
    "stages",
    "references",
    "hardware",
    "response",
    "control",
    "multiaxis",
    "xu_li_2010",
)


def places() -> dict[str, str]:
    """Return the page of each public name, by its full name as a user writes it."""
    import piezotrack as pt

    top = set(vars(pt)["__all__"])
    found = {}
    for room in ROOMS:
        module = getattr(pt, room)
        for name in sorted(module.__all__, key=lambda one: (not one[0].islower(), one.lower())):
            value = getattr(module, name)
            if inspect.ismodule(value):
                for inner in value.__all__:
                    found[f"piezotrack.{room}.{name}.{inner}"] = room
            else:
                found[f"piezotrack.{name}" if name in top else f"piezotrack.{room}.{name}"] = room
    for name in sorted(top - set(ROOMS)):
        value = getattr(pt, name)
        if name != "__version__" and not inspect.ismodule(value):
            home = value.__module__.split(".")[1]
            found.setdefault(f"piezotrack.{name}", home if home in ROOMS else "index")
    return found


def pages() -> dict[str, str]:
    """Return the text of each page, in Markdown, by its name without an ending."""
    names = places()
    written = {"commands": commands()}
    for room in ROOMS:
        own = [name for name, page in names.items() if page == room]
        written[room] = f"# pt.{room}\n\n{first(f'piezotrack.{room}')}\n\n{entries(own)}"
    rest = [name for name, page in names.items() if page == "index"]
    errors = [name for name in rest if isinstance(valued(name), type)]
    others = [name for name in rest if name not in errors]
    listed = "\n".join(["commands", *ROOMS])
    written["index"] = (
        "# Reference\n\nPython: `import piezotrack as pt`; the same text is printed by"
        " `help(pt.identify)`.\n\n"
        f"```{{toctree}}\n:maxdepth: 1\n\n{listed}\n```\n\n## Figures\n\n{entries(others)}\n\n"
        f"## Exceptions\n\n{entries(errors)}"
    )
    return written


def entries(names: list[str]) -> str:
    """Return the directives that document public names."""
    rows = [f"- `{short(name)}`: {first(name)}" for name in names]
    blocks = [f"```{{eval-rst}}\n{entry(name)}{gallery(name)}\n```\n" for name in names]
    return "\n".join([*rows, "", *blocks])


def short(name: str) -> str:
    """Return a public name as a user writes it."""
    return name.replace("piezotrack", "pt", 1)


def valued(name: str) -> Any:
    """Return what has a public name."""
    module, _, last = name.rpartition(".")
    return getattr(import_module(module), last)


def first(name: str) -> str:
    """Return the first sentence of a docstring, in one line of Markdown."""
    value = valued(name)
    text = union(value) if isinstance(value, types.UnionType) else inspect.getdoc(value) or ""
    return " ".join(text.partition("\n\n")[0].split()).replace("``", "`")


def union(value: types.UnionType) -> str:
    """Name the types of a union, which cannot have a docstring."""
    return f"One of {', '.join(f'`{kind.__name__}`' for kind in value.__args__)}."


def gallery(name: str) -> str:
    """Return the directive that shows the scripts of the gallery that use a name."""
    use = re.compile(rf"\b{re.escape(short(name))}\b(?!\.[A-Z])")
    if not any(use.search(script.read_text("utf-8")) for script in SCRIPTS.glob("*.py")):
        return ""
    return f"\n\n.. rubric:: In the gallery\n\n.. minigallery:: {name}"


def entry(name: str) -> str:
    """Return the directive of one name."""
    value = valued(name)
    if isinstance(value, types.UnionType):
        return f".. py:data:: {name}\n\n   {union(value)}"
    if inspect.isclass(value) and issubclass(value, BaseException):
        return f".. autoexception:: {name}\n   :members:"
    if inspect.isclass(value):
        return f".. autoclass:: {name}\n   :members:\n   :inherited-members:"
    return f".. autofunction:: {name}"


def commands() -> str:
    """Return the page of the commands: the help of each, as it is printed."""
    overview = printed()
    lines = ["# Commands\n", f"```text\n{overview}\n```\n"]
    for name in re.findall(r"^  ([a-z][a-z-]*)  ", overview, re.MULTILINE):
        lines += [f"## {name}\n", f"```text\n{printed(name)}\n```\n"]
    return "\n".join(lines)


def printed(*command: str) -> str:
    """Return the help of a command in 88 columns."""
    from piezotrack.cli.commands import app

    run: Any = app
    with (
        patch.dict(os.environ, COLUMNS="88", NO_COLOR="1"),
        contextlib.redirect_stdout(io.StringIO()) as out,
        contextlib.suppress(SystemExit),
    ):
        run([*command, "--help"], prog_name="piezotrack", standalone_mode=False)
    return "\n".join(line.rstrip() for line in out.getvalue().strip().splitlines())


def write(app: Sphinx) -> None:
    """Write the pages that changed."""
    folder = Path(app.srcdir, "reference")
    folder.mkdir(exist_ok=True)
    for name, text in pages().items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")


def check(_: Sphinx, env: Any) -> None:
    """Warn of each public name without an entry."""
    known = env.get_domain("py").objects
    for name, page in places().items():
        if name not in known:
            logging.getLogger(__name__).warning("%s has no entry on reference/%s", name, page)


def setup(app: Sphinx) -> dict[str, bool]:
    """Write before the pages are read, check when all are."""
    app.connect("builder-inited", write)
    app.connect("env-check-consistency", check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
