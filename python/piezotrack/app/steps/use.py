"""Use."""

from __future__ import annotations

from .. import parts


class UseStep:
    """Use."""

    title = "Use"
    actions: dict = {}

    def light(self, desk):
        return "grey", "not begun"

    def page(self, desk):
        return [parts.text("soon", "Use", "soon")]

    def python(self, desk):
        return []

    def commands(self, desk):
        return []
