"""Stages of several axes that move each other: responses, modal models, decoupling, loops."""

from __future__ import annotations

from .._support.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, globals())
