"""Stage models.

One file a model, in a folder by family; their base class and registry, their inverse for
feedforward, the virtual stage to experiment on, and the stage of two axes.
"""

from __future__ import annotations

from .._support.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, globals())
