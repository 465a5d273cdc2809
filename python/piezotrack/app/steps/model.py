"""Model."""

from __future__ import annotations

from .. import parts


class ModelStep:
    """Model."""

    title = "Model"
    actions: dict = {}

    def light(self, desk):
        return "grey", "not begun"

    def page(self, desk):
        return [parts.text("soon", "Model", "soon")]

    def python(self, desk):
        return []

    def commands(self, desk):
        return []
