"""Public names of a package, listed once in its stub and imported when first used."""

from __future__ import annotations

import os

# As type checkers read it; importing typing would cost more than all else here.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["attach"]


def attach(
    package: str, namespace: dict[str, object]
) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """Make the lazy loader of a package.

    The public names are the lines ``from .module import name as name`` of the ``__init__.pyi``
    beside the package's ``__init__.py``; ``from . import room as room`` is a package itself.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    namespace : dict
        Its ``globals()``.

    Returns
    -------
    getattr, dir, all
        For its ``__getattr__``, ``__dir__`` and ``__all__``.

    Examples
    --------
    >>> import piezotrack.references as room
    >>> get, _, names = attach(room.__name__, vars(room))
    >>> "sine" in names, get("sine").__module__
    (True, 'piezotrack.references.waveforms')
    """
    homes = _homes(os.path.join(os.path.dirname(str(namespace["__file__"])), "__init__.pyi"))
    names = sorted(homes)

    def get(name: str) -> object:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        from importlib import import_module

        home = homes[name]
        if home == ".":
            value: object = import_module(f".{name}", package)
        else:
            value = getattr(import_module(home, package), name)
        namespace[name] = value
        return value

    def listed() -> list[str]:
        # Not what the package itself imports.
        return sorted({*names, *(name for name in namespace if name.startswith("__"))})

    return get, listed, names


def _homes(path: str) -> dict[str, str]:
    """Read from a stub which module each public name is in."""
    with open(path, encoding="utf-8") as stub:
        # One name a line, as the formatter keeps it, or in parentheses where it is too long for
        # one; importing ast would be slower than all else.
        text = stub.read().replace("import (\n", "import ")
    lines = [line.split() for line in text.splitlines() if line.startswith("from ")]
    return {name: home for _, home, _, name, *_ in lines}
