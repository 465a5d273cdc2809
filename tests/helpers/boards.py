"""Firmware projects: built, and run as a process or in an emulator."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import pytest

import piezotrack as pt
from c_exports import needs_gcc

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MACHINES = {"m4": "mps2-an386", "m7": "mps2-an500"}
needs_cross = pytest.mark.skipif(
    not (shutil.which("arm-none-eabi-gcc") and shutil.which("qemu-system-arm")),
    reason="no board is emulated: arm-none-eabi-gcc or qemu-system-arm is not installed",
)
# The same with a timer of their own as the clock.
TIMED = {f"{name}-timer": machine for name, machine in MACHINES.items()}
# A process on this computer, always; and boards in QEMU where it is there.
BOARDS = [
    pytest.param("host", marks=needs_gcc),
    *(
        pytest.param(name, marks=[needs_cross, pytest.mark.slow])
        for name in (*MACHINES, "m4-timer")
    ),
]
# Time of an instruction, 64 ns: what a step takes does not depend on how busy the computer is.
COUNTED = ("-icount", "shift=6")
# Displacements at both ends of the ADC [m].
SPAN = (-2e-5, 1.5e-4)
# On a busy computer a thread may wait for long.
PATIENT = ("-DLINK_TIMEOUT_MS=4000u", "-DSAMPLING_TIMEOUT_MS=60000u")


def made(folder: Path, target: str, *flags: str) -> str:
    """Make a target of a project; return what it prints (an emulator on stderr)."""
    done = subprocess.run(
        ["make", "--silent", target],
        cwd=folder,
        env={**os.environ, "CFLAGS": " ".join((*PATIENT, *flags))},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@contextmanager
def booted(
    controller: pt.Controller,
    folder: Path,
    board: str,
    converters: tuple[str, int],
    *settings: str,
    emulator: tuple[str, ...] | None = None,
    link: str = "",
    **options: Any,
) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Export, build and start; the address of the firmware, and its process.

    A board with a timer counts its time in instructions, where the emulator is told nothing else.
    """
    if not (folder / "Makefile").exists():
        pt.control.export_controller(controller, folder, to="firmware", name="axis", **options)
    made(folder, board)
    port = str(converters[1])
    if board == "host":
        command = ["./axis-host", "0", port, *settings]
        address = ""
    else:
        place = f"127.0.0.1:{_free_port()}"
        command = [
            *("qemu-system-arm", "-M", (MACHINES | TIMED)[board]),
            *("-nographic", "-monitor", "none"),
            *(emulator if emulator is not None else COUNTED if board in TIMED else ()),
            *("-kernel", f"axis-{board}.elf"),
            *("-serial", link or f"tcp:{place},server=on,wait=off,nodelay=on"),
            *("-serial", f"tcp:127.0.0.1:{port},nodelay=on"),
        ]
        address = f"firmware://{place}"
    with subprocess.Popen(
        command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        try:
            assert process.stdout is not None
            if not address:
                address = process.stdout.readline().strip()
            yield address, process
        finally:
            process.kill()


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def connected(address: str) -> pt.hardware.FirmwareDevice:
    """Connect, as soon as the emulator listens."""
    for attempt in range(50):
        try:
            device = pt.hardware.connect(address)
        except pt.DeviceError:
            if attempt == 49:
                raise
            time.sleep(0.2)
        else:
            assert isinstance(device, pt.hardware.FirmwareDevice)
            return device
    raise AssertionError


def controller(**parts: Any) -> pt.Controller:
    """A loop at 1 kHz, with some parts replaced."""
    given: dict[str, Any] = {
        "dt": 1e-3,
        "limits": (0.0, 75.0),
        "span": SPAN,
        "feedback": pt.Pid.from_um(kp=0.02, ti=0.005),
        "filters": [pt.Notch(160.0)],
    }
    return pt.Controller(**given | parts)


def within(condition: Any, seconds: float = 20.0) -> bool:
    """Whether a condition holds within a time."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.01)
    return True
