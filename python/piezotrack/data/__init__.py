"""Records of drive and displacement.

The data set, its reader and columns, resampling, the diagnostics of a record, and the measured
records that come with the package.
"""

from __future__ import annotations

from .._support.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, globals())
