"""Choice between models: those that were tried, and on what."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

__all__ = ["Selection", "Trial"]


class Trial(NamedTuple):
    """A model that was tried.

    Attributes
    ----------
    model, title : str
        Name of the model, and its title.
    rms : float
        Root mean square of the residual on the part that was not fitted [m], amplitudes and rates
        of the drive that differ by a factor of two counting alike.
    seconds : float
        Time that it took [s]; 0 where it was read from a file.
    """

    model: str
    title: str
    rms: float
    seconds: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Selection:
    """Choice of ``model="auto"``.

    Attributes
    ----------
    trials : tuple of Trial
        The models that were tried, the best first.
    fitted_until : float
        End of the part of the window that these were fitted to [s]; they were judged on the rest.

    Examples
    --------
    >>> import piezotrack as pt
    >>> fit = pt.identify(pt.datasets.dbo_training()[3.0:5.0], progress=False)
    >>> fit.selection.trials[0].model == fit.model.info.name
    True
    """

    trials: tuple[Trial, ...]
    fitted_until: float
