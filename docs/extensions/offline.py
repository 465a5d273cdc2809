"""Check of the built site: it loads no script, style, font or picture from a network."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

from sphinx.util import logging

if TYPE_CHECKING:
    from collections.abc import Iterator

    from sphinx.application import Sphinx

__all__ = ["foreign", "setup"]

# A link to another site is followed by the reader only, and so is an <a>.
LOADED = re.compile(
    r"<(?:script|img|iframe|source|video|audio|embed)\b[^>]*\bsrc\s*=\s*[\"']?((?:https?:)?//[^\"'\s>]+)"
    r"|<link\b(?=[^>]*\brel\s*=\s*[\"']?(?:stylesheet|preload|icon|preconnect|dns-prefetch))"
    r"[^>]*\bhref\s*=\s*[\"']?((?:https?:)?//[^\"'\s>]+)"
    r"|@import\s+(?:url\()?[\"']?((?:https?:)?//[^\"')\s]+)"
    r"|\burl\(\s*[\"']?((?:https?:)?//[^\"')\s]+)",
    re.IGNORECASE,
)


def foreign(text: str) -> list[str]:
    """Return the addresses on a network that a page or a style sheet loads by itself."""
    return [next(filter(None, found.groups())) for found in LOADED.finditer(text)]


def offences(folder: Path) -> Iterator[str]:
    """Yield each such address of a site, with its file."""
    for path in sorted(folder.rglob("*")):
        if path.suffix in (".html", ".css"):
            for address in foreign(path.read_text("utf-8")):
                yield f"{path.relative_to(folder)}: {address} is loaded from a network"


def check(app: Sphinx, error: Exception | None) -> None:
    """Warn of each, at the end of a build of pages."""
    if error is None and app.builder.format == "html":
        for offence in offences(Path(app.outdir)):
            logging.getLogger(__name__).warning(offence)


def setup(app: Sphinx) -> dict[str, bool]:
    """Check when the site is built."""
    app.connect("build-finished", check)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
