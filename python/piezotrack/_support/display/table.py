"""Tables: columns with head, unit and format, as text, HTML, Markdown and data frame."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

from .frames import frame_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

__all__ = ["Column", "Table", "words"]


class Column(NamedTuple):
    """A column of a table.

    Attributes
    ----------
    head : str
        Its title.
    unit : str
        Unit of its values.
    format : str
        Format of its values; None is written as "-".
    width : int
        Characters in a line of text, which longer cells exceed; 0 for those of the widest cell.
    before : int
        Spaces before it in a line of text.
    left : bool
        Whether it is aligned to the left.
    """

    head: str = ""
    unit: str = ""
    format: str = ""
    width: int = 0
    before: int = 2
    left: bool = False


@dataclass(frozen=True)
class Table:
    """Rows of values, each written in the format of its column.

    Attributes
    ----------
    columns : tuple of Column
        The columns; the first names the row.
    rows : sequence of sequences
        The values.
    title : str
        Above a table in HTML.

    Examples
    --------
    >>> table = Table((Column("model", left=True), Column("rms", "um", ".3g")), [("dahl", 0.1234)])
    >>> print(table.text())
      model  rms um
      dahl    0.123
    >>> print(table.markdown())
    | model | rms [um] |
    | --- | --- |
    | dahl | 0.123 |
    """

    columns: Sequence[Column]
    rows: Sequence[Sequence[object]]
    title: str = ""

    @property
    def cells(self) -> list[list[str]]:
        """The values as text, row by row."""
        return [
            ["-" if value is None else format(value, column.format)
             for column, value in zip(self.columns, row, strict=True)]
            for row in self.rows
        ]  # fmt: skip

    @property
    def heads(self) -> list[str]:
        """Titles with units in brackets."""
        return [f"{one.head} [{one.unit}]" if one.unit else one.head for one in self.columns]

    def lines(self, *, heads: bool = True) -> list[str]:
        """Write lines of text, below one with the titles where `heads`."""
        titles = [f"{one.head} {one.unit}".rstrip() for one in self.columns]
        grid = [titles, *self.cells] if heads else self.cells
        widest = [max(map(len, cells)) for cells in zip(*grid, strict=True)]
        widths = [one.width or wide for one, wide in zip(self.columns, widest, strict=False)]
        return [
            "".join(
                " " * one.before + (cell.ljust(width) if one.left else cell.rjust(width))
                for one, width, cell in zip(self.columns, widths, row, strict=True)
            ).rstrip()
            for row in grid
        ]

    def text(self) -> str:
        """Write it for a terminal."""
        return "\n".join(self.lines())

    def html(self, *, bold: int | None = None) -> str:
        """Write a ``table`` element as a notebook shows it, with one row in bold.

        The titles of the columns are left out where there are none.
        """
        head = "".join(f"<th>{escape(one)}</th>" for one in self.heads) if any(self.heads) else ""
        body = []
        for i, (name, *cells) in enumerate(self.cells):
            style = ' style="font-weight: bold"' if i == bold else ""
            data = "".join(f"<td{style}>{escape(cell)}</td>" for cell in cells)
            body.append(f"<tr><th>{escape(name)}</th>{data}</tr>")
        return (
            f"<table><caption>{escape(self.title)}</caption>"
            f"{f'<thead><tr>{head}</tr></thead>' if head else ''}"
            f"<tbody>{''.join(body)}</tbody></table>"
        )

    def markdown(self) -> str:
        """Write it for a page."""
        rows = [self.heads, ["---"] * len(self.columns), *self.cells]
        plain = ([cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in rows)
        return "\n".join(f"| {' | '.join(row)} |" for row in plain)

    def to_frame(self) -> Any:
        """Return the values as a data frame of pandas, whose titles have the units.

        Raises
        ------
        ParameterError
            pandas is not installed.
        """
        names = ["_".join(filter(None, (one.head, one.unit))) for one in self.columns]
        return frame_of({name: [row[i] for row in self.rows] for i, name in enumerate(names)})


def words(title: str, rows: Iterable[Sequence[str]], heads: Sequence[str] = ()) -> Table:
    """Make a table of words, whose columns may have titles.

    Examples
    --------
    >>> words("Lags", [("a", "1 < 2")]).html()
    '<table><caption>Lags</caption><tbody><tr><th>a</th><td>1 &lt; 2</td></tr></tbody></table>'
    """
    table = list(rows)
    titles = list(heads) or [""] * max((len(row) for row in table), default=0)
    return Table([Column(title) for title in titles], table, title)
