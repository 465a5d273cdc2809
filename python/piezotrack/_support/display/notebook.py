"""Figures that a notebook shows once."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

__all__ = ["Picture"]


class Picture(Figure):
    """A figure of pyplot that is shown once where it is the last line of a notebook's cell.

    The notebook shows the value of the last line, and then the inline backend all open figures:
    without this the same figure twice.
    """

    def savefig(self, *args: Any, **keywords: Any) -> None:
        """Save it as Matplotlib does; letters of a PDF are TrueType, as journals ask for."""
        with mpl.rc_context({"pdf.fonttype": 42}):
            super().savefig(*args, **keywords)

    def _ipython_display_(self) -> None:
        if "inline" in mpl.get_backend():
            plt.close(self)
        # By IPython's protocol: it is shown as any other figure.
        raise NotImplementedError
