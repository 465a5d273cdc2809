"""From a record to a model.

Swarm search, least squares, step response, sensor noise, cross-talk, the comparison of models and
the model files; tables and pictures of the results are in `views`.
"""

from __future__ import annotations

from .._support.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, globals())
