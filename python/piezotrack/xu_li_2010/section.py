"""A section of the report: a table with a heading and a text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

__all__ = ["Section"]


@dataclass(frozen=True, kw_only=True)
class Section:
    """A table with a heading and a text.

    Attributes
    ----------
    title, text : str
        Heading, and explanation of the table.
    heads : tuple of str
        Titles of the columns, with units.
    rows : tuple of tuple of str
        Cells.
    """

    title: str
    text: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def document(self) -> dict[str, Any]:
        """Content of the JSON file."""
        return {
            "title": self.title,
            "text": self.text,
            "columns": list(self.heads),
            "rows": [list(row) for row in self.rows],
        }
