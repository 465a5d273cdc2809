"""References that a stage has to follow.

Motions and waveforms of one axis, paths of two, references read from files, and the text form of
both that the command line takes.
"""

from __future__ import annotations

from .._support.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, globals())
