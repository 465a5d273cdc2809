"""Distributions of other people, as an installer leaves them in a folder."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path


def install(folder: Path, code: str, *, group: str, name: str, module: str, function: str) -> None:
    """Put a module into a folder, with an entry point for one of its functions."""
    (folder / f"{module}.py").write_text(code, encoding="utf-8")
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n", encoding="utf-8"
    )
    (info / "entry_points.txt").write_text(
        f"[{group}]\n{name} = {module}:{function}\n", encoding="utf-8"
    )
