"""From a log of a piezo nanopositioner to an identified hysteresis model.

>>> import piezotrack as pt
>>> stage = pt.DahlStage.xu_li_2010()
>>> stage.stiffness
26065.0
"""

from __future__ import annotations

import os

from ._core import __version__ as __version__


def _read_homes() -> dict[str, str]:
    """Read from the stub beside this file which module each public name is in."""
    path = os.path.join(os.path.dirname(__file__), "__init__.pyi")
    with open(path, encoding="utf-8") as stub:
        # One name a line, as the formatter keeps it, or in parentheses where it is too long for
        # one; importing ast would cost more than all else.
        text = stub.read().replace("import (\n", "import ")
    lines = [line.split() for line in text.splitlines() if line.startswith("from ")]
    return {name: home for _, home, _, name, *_ in lines}


_HOMES = _read_homes()
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> object:
    """Import a public name when it is first used: some are heavy."""
    if name not in _HOMES:
        raise AttributeError(f"module 'piezotrack' has no attribute {name!r}")
    from importlib import import_module

    if _HOMES[name] == ".":
        # A package of this one, which the import has set.
        return import_module(f".{name}", __name__)
    value = getattr(import_module(_HOMES[name], __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
