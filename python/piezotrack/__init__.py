"""From a log of a piezo nanopositioner to an identified hysteresis model.

>>> import piezotrack as pt
>>> stage = pt.DahlStage.xu_li_2010()
>>> stage.stiffness
26065.0
"""

from __future__ import annotations

from ._core import __version__ as __version__
from ._support.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, globals())
