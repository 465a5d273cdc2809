"""Controllers and their simulation.

Controller and components, stability of the loop, tracking with one axis and contouring with two;
pictures stand beside their results.
"""

from __future__ import annotations

from .._support.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, globals())
