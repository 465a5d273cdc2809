"""From a log of a piezo nanopositioner to an identified hysteresis model.

>>> import piezotrack as pt
>>> stage = pt.DahlStage.xu_li_2010()
>>> stage.stiffness
26065.0
"""

from __future__ import annotations

from ._support.lazy import attach

_named, __dir__, __all__ = attach(__name__, globals())


def __getattr__(name: str) -> object:
    # The compiled module is not loaded before it is used, so that Ctrl-C is answered in words.
    if name == "__version__":
        from ._core import __version__

        return __version__
    return _named(name)
