"""A window of the page without a browser."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from piezotrack.app.session import Session

if TYPE_CHECKING:
    from piezotrack.app.desk import Desk
    from piezotrack.app.device import DeviceProcess


class Window:
    """A session without a browser."""

    def __init__(self, device: DeviceProcess | None = None) -> None:
        self.answers: list[tuple[dict[str, Any], bytes | None]] = []
        self.session = Session(
            lambda answer, content: self.answers.append((answer, content)), device
        )
        self.desk: Desk = self.session.desk
        self.parts: dict[str, dict[str, Any]] = {}

    def do(self, do: str, **given: Any) -> tuple[dict[str, Any], bytes | None]:
        """Send a message and wait for its answer."""
        number, seen = 1 + len(self.answers), len(self.answers)
        self.session.take({"do": do, "seq": f"{number}", **given})
        until = time.monotonic() + 120.0
        while time.monotonic() < until:
            for answer, content in self.answers[seen:]:
                if answer["seq"] == f"{number}":
                    self.parts |= answer["changed"]
                    return answer, content
            time.sleep(0.005)
        raise AssertionError(f"no answer to {do}")

    def set(self, step: str, **values: Any) -> dict[str, Any]:
        return self.do("set", step=step, values=values)[0]

    def finish(self) -> None:
        """Wait for what is computed in the background."""
        until = time.monotonic() + 120.0
        while self.desk.running:
            assert time.monotonic() < until
            time.sleep(0.02)
        self.do("whole")

    def take(self, name: str) -> tuple[str, bytes]:
        answer, content = self.do(name)
        assert answer["error"] is None, answer["error"]
        assert content is not None
        return answer["download"], content
