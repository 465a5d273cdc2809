"""Devices: amplifiers and sensors that play a table of voltages and record a displacement.

What is precise is buffered: a whole table goes out on the device's clock, and a record comes back
on the same clock. `Device` is the protocol; an adapter of your own is thirty lines.
"""

from __future__ import annotations

from .._support.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, globals())
