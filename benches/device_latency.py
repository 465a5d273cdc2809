"""How late a loop on this computer is, over each path to a device: a table for docs/hardware.md.

Run it as `python benches/device_latency.py`.
"""

from __future__ import annotations

import subprocess
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

import piezotrack as pt
from piezotrack.control.on_device import latency

if TYPE_CHECKING:
    from collections.abc import Iterator

DT, TICKS = 0.005, 2000


@contextmanager
def served(protocol: str) -> Iterator[str]:
    """Address of a virtual controller or instrument in a process of its own."""
    command = [sys.executable, "-m", "piezotrack", "serve", protocol, "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
        try:
            assert child.stdout is not None
            yield child.stdout.readline().split()[2].rstrip(",")
        finally:
            child.terminate()


def row(name: str, address: str) -> str:
    device = pt.hardware.connect(address)
    late = latency.measure_latency(device, DT)
    device.close()
    figures = (late.median, late.p99, late.worst)
    return f"| {name} | " + " | ".join(f"{1e3 * one:.2f} ms" for one in figures) + " |"


def main() -> None:
    latency.TICKS, latency.LONGEST = TICKS, TICKS * DT
    print("| path | median | 99th percentile | worst |\n| --- | --- | --- | --- |")
    print(row("virtual stage in the same process", "virtual:"))
    with served("gcs") as address:
        print(row("GCS over TCP, the controller in another process", address))
    with served("scpi") as address:
        print(row("SCPI over TCP, the instrument in another process", address))


if __name__ == "__main__":
    main()
