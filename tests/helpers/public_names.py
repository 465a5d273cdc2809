"""Public names with their arguments, one a line, to be compared with those of earlier versions.

``python tests/helpers/public_names.py`` writes tests/public_names.txt.
"""

from __future__ import annotations

import inspect
import re
from functools import reduce
from typing import TYPE_CHECKING, Any

from reference_pages import places

from folders import ROOT

if TYPE_CHECKING:
    from collections.abc import Iterator

SNAPSHOT = ROOT / "tests" / "public_names.txt"


def public_names() -> list[str]:
    """List functions, classes and what is public of a class: ``piezotrack.Pid.kp``."""
    return sorted({line for name in places() for line in _lines(name, _value(name))})


def unannounced(before: list[str], after: list[str], entry: str) -> list[str]:
    """Return the names that differ and that an entry of the changelog does not mention."""
    words = set(re.findall(r"\w+", entry))
    names = {line.partition("(")[0].split(" ")[0] for line in set(before) ^ set(after)}
    return sorted(name for name in names if name.rpartition(".")[2] not in words)


def _value(name: str) -> Any:
    import piezotrack

    return reduce(getattr, name.split(".")[1:], piezotrack)


def _lines(name: str, value: Any) -> Iterator[str]:
    if not inspect.isclass(value):
        yield f"{name}{_arguments(value)}" if callable(value) else name
        return
    is_error = issubclass(value, Exception)
    is_protocol = getattr(value, "_is_protocol", False)
    yield name if is_error or is_protocol else f"{name}{_arguments(value)}"
    for attribute, member in inspect.getmembers_static(value):
        own = any(attribute in vars(one) for one in value.__mro__ if "piezotrack" in one.__module__)
        if attribute.startswith("_") or not own:
            continue
        found = member.__func__ if isinstance(member, (staticmethod, classmethod)) else member
        yield f"{name}.{attribute}{_arguments(found) if inspect.isfunction(found) else ''}"
    for field in getattr(value, "__dataclass_fields__", ()):
        yield f"{name}.{field}"


def _arguments(value: Any) -> str:
    """Write a signature without types, and defaults that are objects without their address."""
    signature = inspect.signature(value)
    parameters = [
        one.replace(annotation=inspect.Parameter.empty)
        for one in signature.parameters.values()
        if one.name not in ("self", "cls")
    ]
    text = str(signature.replace(parameters=parameters, return_annotation=signature.empty))
    return re.sub(r"<([\w.]+)[^>]*>", r"<\1>", text)


if __name__ == "__main__":
    SNAPSHOT.write_text("\n".join(public_names()) + "\n", encoding="utf-8")
