"""Motion."""

from __future__ import annotations

from .. import parts


class MotionStep:
    """Motion."""

    title = "Motion"
    actions: dict = {}

    def light(self, desk):
        return "grey", "not begun"

    def page(self, desk):
        return [parts.text("soon", "Motion", "soon")]

    def python(self, desk):
        return []

    def commands(self, desk):
        return []
