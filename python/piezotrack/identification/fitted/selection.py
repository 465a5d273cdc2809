"""One of the models that a choice between models tried."""

from __future__ import annotations

from typing import NamedTuple

__all__ = ["Trial"]


class Trial(NamedTuple):
    """One kind of stage that was tried.

    Attributes
    ----------
    model, title : str
        Name of the model, and its title.
    rms : float
        Root mean square of the residual on the part that was not fitted [m]; where the record is
        too short to be parted, on all of it.
    """

    model: str
    title: str
    rms: float
