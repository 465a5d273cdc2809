"""Figures that a notebook shows once."""

from __future__ import annotations

import matplotlib as mpl
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

__all__ = ["Picture"]


class Picture(Figure):
    """A figure of pyplot that is shown once where it is the last line of a notebook's cell.

    The inline backend shows all open figures at the end of a cell, and the notebook the value of
    the last line: the same figure twice.
    """

    def _ipython_display_(self) -> None:
        if "inline" in mpl.get_backend() and plt.fignum_exists(self.number):
            return
        # A figure that is no longer open, as in a later cell, is shown as any other.
        raise NotImplementedError
