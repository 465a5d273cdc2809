"""Frequency response of a stage, measured with its uncertainty."""

from __future__ import annotations

from .._support.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, globals())
