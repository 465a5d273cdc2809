"""Safe printing: characters that would steer the terminal are shown as Python writes them."""

from __future__ import annotations

import io
import os
import re
import sys

# As type checkers read it; importing typing takes long.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import TextIO

__all__ = ["PlainStream", "one_line", "prepare_streams"]

# Control characters, except the tab and the end of a line, and those that reverse the direction.
STEERING = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")


def prepare_streams() -> None:
    """Make stdout and stderr fit for any text."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            # Closed by the caller. The place is taken, or a result would be opened there.
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper):
            # The name of a file may have characters that the terminal cannot print.
            stream.reconfigure(errors="backslashreplace")
        setattr(sys, name, PlainStream(stream))


class PlainStream:
    """A stream that escapes what would steer the terminal.

    File names, and names in files, are printed in many places; this is the one that all pass.

    Attributes
    ----------
    unescaped : TextIO
        The stream itself, for a progress bar.
    """

    def __init__(self, stream: TextIO) -> None:
        self.unescaped = stream

    def write(self, text: str) -> int:
        """Write text."""
        self.unescaped.write(_escaped(text))
        return len(text)

    def __getattr__(self, name: str) -> object:
        return getattr(self.unescaped, name)


def one_line(text: str) -> str:
    """Write a text in one line, whatever names are in it."""
    return _escaped(text).replace("\n", "\\n")


def _escaped(text: str) -> str:
    return STEERING.sub(lambda found: ascii(found[0])[1:-1], text)
