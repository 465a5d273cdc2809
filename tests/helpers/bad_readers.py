"""Functions that open a file as damaged ones make libraries do."""

from __future__ import annotations

import ctypes
import os
import time
from typing import TYPE_CHECKING

import numpy as np

from piezotrack.data.formats.table import Channel, ChannelTable

if TYPE_CHECKING:
    from piezotrack.data.formats.source import Source


def opens(source: Source) -> ChannelTable:
    """Do what the text of the file says when opened, and what its second line says when read."""
    opening, _, reading = source.content().decode().partition("\n")
    do(opening)

    def read() -> object:
        do(reading.strip())
        return np.arange(5, dtype=np.float32)

    return ChannelTable(source, [Channel("u_V", 5, read)])


def do(what: str) -> None:
    if what == "hang":
        # With the lock of the interpreter held, as a library does.
        ctypes.PyDLL(None).sleep(1000)
    elif what == "end":
        os.abort()
    elif what == "take":
        np.ones(1 << 40)
    elif what == "print":
        os.write(1, b'{"nothing": 1}\n')
    elif what == "wait":
        time.sleep(0.2)
    elif what == "fail":
        raise ZeroDivisionError("a fault of ours")
