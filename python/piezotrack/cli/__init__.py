"""The command ``piezotrack``.

This file imports little, so that Ctrl-C is answered in words from the first instant on.
"""

from __future__ import annotations

import os

__all__ = ["main"]


def main() -> None:
    """Run the command with the arguments of the process."""
    try:
        from .process import interruption

        interruption.answer_signals()
    except KeyboardInterrupt:
        os.write(2, b"piezotrack: interrupted\n")
        os._exit(130)
    from .process.terminal import prepare_streams

    prepare_streams()
    try:
        from .commands import run

        run()
    finally:
        interruption.leave_if_stopped()
