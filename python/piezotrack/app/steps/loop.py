"""Loop."""

from __future__ import annotations

from .. import parts


class LoopStep:
    """Loop."""

    title = "Loop"
    actions: dict = {}

    def light(self, desk):
        return "grey", "not begun"

    def page(self, desk):
        return [parts.text("soon", "Loop", "soon")]

    def python(self, desk):
        return []

    def commands(self, desk):
        return []
