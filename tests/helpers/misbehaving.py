"""An instrument in another process that misbehaves on purpose, over the SCPI template.

`misbehaving("stale", after=100)` is well behaved for 100 readings and then has the fault, for
`count` readings or for ever; run as a program it is the instrument itself, and prints its port.
"""

from __future__ import annotations

import argparse
import math
import re
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

FAULTS = {
    "none": "behaves",
    "stale": "repeats one reading",
    "silent": "takes messages, answers nothing",
    "late": "answers, but after `late` seconds",
    "nan": "answers 9.91E+37, SCPI's not-a-number",
    "half": "answers the first half of a line, without its end",
    "drop": "closes the connection in place of an answer",
    "clip": "puts out 30 V at most, and says nothing about it",
    "nm": "answers nanometres, without saying so",
    "nm unit": "answers nanometres, with their unit",
    "jump": "reads 20 um more",
    "twice": "answers every message twice",
    "garbage": "answers words",
}
# Voltage to which `clip` clips [V], and size of the `jump` [um].
CLIPPED, JUMP = 30.0, 20.0


@contextmanager
def misbehaving(
    fault: str, *, after: int = 0, count: int | None = None, late: float = 1.0
) -> Iterator[tuple[str, int]]:
    """Start the instrument in a process of its own: host and port."""
    assert fault in FAULTS, fault
    options = ["--fault", fault, "--after", str(after), "--late", str(late)]
    options += [] if count is None else ["--count", str(count)]
    program = [sys.executable, str(Path(__file__)), *options]
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as child:
        try:
            assert child.stdout is not None
            yield "127.0.0.1", int(child.stdout.readline())
        finally:
            child.kill()


class Instrument:
    """The virtual instrument, with one fault from the reading `after` on."""

    def __init__(self, fault: str, after: int, count: int | None, late: float) -> None:
        import piezotrack as pt

        device = pt.hardware.VirtualDevice(pt.VirtualStage.xu_li_2010(seed=1))
        self.inside = pt.hardware.VirtualScpi(device)
        self.fault, self.after, self.late = fault, after, late
        self.until = math.inf if count is None else after + count
        self.readings, self.last = 0, "0.000000"

    @property
    def has_fault(self) -> bool:
        return self.after < self.readings <= self.until

    def answer(self, line: str) -> bytes | None:
        """Answer a line: bytes to send, or None to close the connection."""
        reads = "MEAS?" in line.upper()
        self.readings += reads
        fault = self.fault if self.has_fault else "none"
        if fault == "clip":
            line = re.sub(
                r"(?i)\bVOLT ([\d.eE+-]+)", lambda m: f"VOLT {min(float(m[1]), CLIPPED)}", line
            )
        reply = self.inside.answer(line)
        if reply is None:
            return b""
        if not reads:
            # The fault is of the sensor; of the link, where nothing can be read any more.
            return b"" if fault == "silent" else reply.encode() + b"\n"
        return self._spoilt(fault, reply)

    def _spoilt(self, fault: str, answer: str) -> bytes | None:
        if fault == "drop":
            return None
        if fault == "silent":
            return b""
        if fault == "half":
            return answer[: len(answer) // 2].encode()
        if fault == "late":
            time.sleep(self.late)
        number = float(answer)
        text = {
            "stale": self.last,
            "nan": "9.91E+37",
            "nm": f"{1e3 * number:.3f}",
            "nm unit": f"{1e3 * number:.3f} nm",
            "jump": f"{number + JUMP:.6f}",
            "twice": f"{answer}\n{answer}",
            "garbage": "busy",
        }.get(fault, answer)
        if fault == "none":
            self.last = answer
        return text.encode() + b"\n"

    def converse(self, link: socket.socket) -> None:
        rest = b""
        while part := link.recv(65536):
            *lines, rest = (rest + part).split(b"\n")
            for line in lines:
                reply = self.answer(line.decode("ascii", "replace"))
                if reply is None:
                    return
                link.sendall(reply)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fault", choices=FAULTS, default="none")
    parser.add_argument("--after", type=int, default=0, help="readings before the fault")
    parser.add_argument("--count", type=int, help="readings with the fault; default all after")
    parser.add_argument("--late", type=float, default=1.0, help="seconds, of the fault `late`")
    given = parser.parse_args()
    instrument = Instrument(given.fault, given.after, given.count, given.late)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        print(listener.getsockname()[1], flush=True)
        while True:
            link, _ = listener.accept()
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            try:
                with link:
                    instrument.converse(link)
            except OSError:
                continue


if __name__ == "__main__":
    main()
