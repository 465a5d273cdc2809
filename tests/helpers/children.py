"""Python in a process of its own: what may end it must not end the tests."""

from __future__ import annotations

import subprocess
import sys

# Address space that is left to a process once everything is imported.
LIMIT = """
import resource
pages = int(open("/proc/self/statm").read().split()[0])
size = pages * resource.getpagesize() + {room}
resource.setrlimit(resource.RLIMIT_AS, (size, size))
"""


def child(code: str, *, room: int | None = None) -> subprocess.CompletedProcess[str]:
    """Run a program after NumPy and piezotrack are imported; `room` [bytes] limits its memory."""
    limit = "" if room is None else LIMIT.format(room=room)
    # The packages are imported when first used.
    imports = "import numpy as np\nimport piezotrack as pt\npt.DahlStage, pt.Controller, pt.track\n"
    return subprocess.run(
        [sys.executable, "-c", imports + limit + code],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
