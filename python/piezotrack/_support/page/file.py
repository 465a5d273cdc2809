"""A page in a file, whose ending chooses the format."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import ParameterError
from ..arguments import expect
from ..display.look import without_glyph_warnings
from ..files.writing import replacing
from .html import html_text
from .pdf import write_pdf

if TYPE_CHECKING:
    from .parts import Page

__all__ = ["page_file", "write_page"]

ENDINGS = (".html", ".pdf")


def page_file(name: str, path: str | os.PathLike[str]) -> Path:
    """Check the name of a page.

    Parameters
    ----------
    name : str
        The argument, for messages.
    path : path-like
        The file.

    Returns
    -------
    pathlib.Path
        The same.

    Raises
    ------
    ParameterError
        It ends otherwise than in ``.html`` or ``.pdf``.
    """
    expect(name, path, (str, os.PathLike), "the name of a file")
    file = Path(path)
    if file.suffix.lower() not in ENDINGS:
        raise ParameterError(name, f"'{file}'", "a file that ends in .html or .pdf")
    return file


def write_page(page: Page, path: str | os.PathLike[str]) -> Path:
    """Write a page, whole or not at all.

    Parameters
    ----------
    page : Page
        Title and sections.
    path : path-like
        The file, ``.html`` or ``.pdf``; replaced where it exists.

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    ParameterError
        It has another ending.
    DataError
        It cannot be written.
    """
    file = page_file("path", path)
    with without_glyph_warnings(), replacing(file) as temporary:
        if file.suffix.lower() == ".pdf":
            write_pdf(page, temporary)
        else:
            temporary.write_text(html_text(page), encoding="utf-8", newline="\n")
    return file
