"""Work for the process of a device that counts how often it is interrupted."""

from __future__ import annotations

import time
from typing import Any

__all__ = ["interruptions"]


def interruptions(device: object, tell: Any) -> int:
    """Wait to be interrupted, then for a second of a way to rest; return the interruptions."""
    del device
    count, until = 0, time.monotonic() + 20.0
    tell("waiting")
    while time.monotonic() < until:
        try:
            time.sleep(0.05)
        except KeyboardInterrupt:
            count += 1
            if count == 1:
                until = time.monotonic() + 1.0
    return count
