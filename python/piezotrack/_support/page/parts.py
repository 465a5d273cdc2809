"""Parts of a page: sections with words, lists, listings, tables and pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure, SubFigure

    from ..display.table import Table

__all__ = ["Listing", "Page", "Part", "Picture", "Section", "Sentences"]


class Sentences(NamedTuple):
    """Sentences, each a paragraph or an item of a list.

    Attributes
    ----------
    lines : tuple of str
        Plain text.
    listed : bool
        Whether they are items of a list.
    """

    lines: tuple[str, ...]
    listed: bool = False


class Listing(NamedTuple):
    """Lines in a font of one width, as of a program.

    Attributes
    ----------
    text : str
        Plain text.
    """

    text: str


@dataclass(frozen=True)
class Picture:
    """A picture as wide as the page.

    Attributes
    ----------
    name : str
        Differs from those of the other pictures of the page.
    draw : callable
        Draws in a figure or a part of one.
    height : float
        Height [inch].
    words : str
        Text for readers who cannot see it.
    """

    name: str
    draw: Callable[[Figure | SubFigure], object]
    height: float
    words: str


Part: TypeAlias = "Sentences | Listing | Table | Picture"


class Section(NamedTuple):
    """A part of a page below a title.

    Attributes
    ----------
    title : str
        Plain text; none for what begins the page.
    parts : tuple of Part
        From top to bottom.
    """

    title: str
    parts: tuple[Part, ...]


@dataclass(frozen=True)
class Page:
    """A title with a line below it, and sections.

    Attributes
    ----------
    title, line : str
        Plain text.
    sections : tuple of Section
        From top to bottom.
    """

    title: str
    line: str
    sections: tuple[Section, ...]
