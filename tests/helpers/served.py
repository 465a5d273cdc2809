"""`piezotrack serve` in a process of its own."""

from __future__ import annotations

import re
import subprocess
from contextlib import contextmanager
from typing import TYPE_CHECKING

from commands import COMMAND

if TYPE_CHECKING:
    from collections.abc import Iterator


@contextmanager
def serving(
    *options: str, protocol: str = "gcs"
) -> Iterator[tuple[subprocess.Popen[str], str, str]]:
    """The command, the address that it prints, and the rest of the line."""
    with subprocess.Popen(
        [*COMMAND, "serve", protocol, "--port", "0", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            found = re.fullmatch(rf"listening from (.*) at ({protocol}://\S+:\d+\S*)\n", line)
            assert found, line
            yield process, found[2], found[1]
        finally:
            process.kill()
