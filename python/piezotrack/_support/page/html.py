"""A page as one HTML file that loads nothing: style and pictures are in it."""

from __future__ import annotations

import io
from base64 import b64encode
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING

from .layout import lay_out
from .parts import Listing, Picture, Sentences

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .parts import Page, Part, Section

__all__ = ["html_text", "svg_text"]

# Width of the pictures [inch], and the size of their letters in points.
WIDTH, TYPE = 6.8, 8.0


def html_text(page: Page) -> str:
    """Write a page; the same content gives the same text.

    Parameters
    ----------
    page : Page
        Title and sections.

    Returns
    -------
    str
        HTML including style and pictures.
    """
    style = files(__package__).joinpath("page.css").read_text(encoding="utf-8")
    body = "\n".join(_section(one) for one in page.sections)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(page.title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        f'<h1>{escape(page.title)}</h1>\n<p class="line">{escape(page.line)}</p>\n'
        f"{body}\n</body>\n</html>\n"
    )


def svg_text(figure: Figure, name: str) -> str:
    """Write a figure as an SVG element, reproducibly.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure.
    name : str
        Ids are made of it: those of several figures on a page have to differ.

    Returns
    -------
    str
        The element.
    """
    import matplotlib as mpl

    buffer = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def _section(section: Section) -> str:
    head = f"<h2>{escape(section.title)}</h2>\n" if section.title else ""
    return f"<section>\n{head}" + "\n".join(map(_part, section.parts)) + "\n</section>"


def _part(part: Part) -> str:
    if isinstance(part, Sentences):
        tag = "li" if part.listed else "p"
        text = "\n".join(f"<{tag}>{escape(one)}</{tag}>" for one in part.lines)
        return f"<ul>\n{text}\n</ul>" if part.listed else text
    if isinstance(part, Listing):
        return f"<pre>{escape(part.text)}</pre>"
    if isinstance(part, Picture):
        return f'<figure><img alt="{escape(part.words)}" src="{_picture(part)}"></figure>'
    return f'<div class="wide">{part.html()}</div>'


def _picture(picture: Picture) -> str:
    """Draw a picture as the address of an image that has its content."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({"font.size": TYPE}):
        figure = Figure(figsize=(WIDTH, picture.height), layout="constrained")
        picture.draw(figure)
        lay_out(figure)
        text = svg_text(figure, picture.name)
    return "data:image/svg+xml;base64," + b64encode(text.encode()).decode()
