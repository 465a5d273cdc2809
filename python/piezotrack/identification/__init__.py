"""From a record to a model.

Swarm search, least squares, step response, sensor noise, cross-talk, the comparison of models and
the model files; tables and pictures stand beside their results.
"""

from .estimates import Estimate
from .least_squares import LeastSquares

__all__ = ["Estimate", "LeastSquares"]
