"""Tables in HTML, as a notebook shows a result."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

__all__ = ["html_table"]


def html_table(
    title: str, rows: Iterable[Sequence[str]], heads: Sequence[str] = (), *, bold: int | None = None
) -> str:
    """Write a table whose first column is of words.

    Parameters
    ----------
    title : str
        Above the table.
    rows : iterable of sequences of str
        Plain text, which is escaped.
    heads : sequence of str, optional
        Titles of the columns.
    bold : int, optional
        Row that is set off.

    Returns
    -------
    str
        A ``table`` element.

    Examples
    --------
    >>> html_table("Lags", [("a", "1 < 2")])
    '<table><caption>Lags</caption><tbody><tr><th>a</th><td>1 &lt; 2</td></tr></tbody></table>'
    """
    head = "".join(f"<th>{escape(one)}</th>" for one in heads)
    lines = []
    for i, (name, *cells) in enumerate(rows):
        style = ' style="font-weight: bold"' if i == bold else ""
        data = "".join(f"<td{style}>{escape(cell)}</td>" for cell in cells)
        lines.append(f"<tr><th>{escape(name)}</th>{data}</tr>")
    return (
        f"<table><caption>{escape(title)}</caption>"
        f"{f'<thead><tr>{head}</tr></thead>' if head else ''}"
        f"<tbody>{''.join(lines)}</tbody></table>"
    )
