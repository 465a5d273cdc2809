"""The paper of Xu and Li 2010, doi 10.1115/1.4001712.

Its procedure, figures and tables on a virtual stage, with published and obtained values side by
side; the calibration of that stage; and the demonstration.
"""

from __future__ import annotations

from .._support.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, globals())
