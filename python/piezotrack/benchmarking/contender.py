"""A contender of the benchmark: what fits a model, and what a fitted model can do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import numpy as np
    from numpy.typing import NDArray

    from ..data.dataset import Dataset
    from .record import BenchmarkRecord

    Array = NDArray[np.float64]

__all__ = ["Contender", "Fitted"]


class Fitted(Protocol):
    """A fitted model."""

    @property
    def values(self) -> int | None:
        """Number of values fitted, the offset included; None where it is not known."""

    @property
    def chosen(self) -> str:
        """Structure that was chosen, in words; empty where nothing was."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Parameters by name, SI, as far as they are single numbers."""

    def predict(self, data: Dataset) -> Array:
        """Displacement in the window of a record, with the offset of the fit [m].

        Only the drive of another record is to decide it, and how that record begins.
        """

    def invert(self, data: Dataset, y: Array) -> tuple[Array, Array] | None:
        """Drive for a displacement along a record with its warm-up, and what the model makes of it.

        Parameters
        ----------
        data : Dataset
            The record.
        y : ndarray, shape (n,)
            Displacement from the first sample of its warm-up on [m].

        Returns
        -------
        u, x : ndarray, shape (n,)
            Drive [V], and the model's displacement under it [m]; None without an inverse.
        """


@dataclass(frozen=True, kw_only=True)
class Contender:
    """A way to a model that takes part in the benchmark.

    Attributes
    ----------
    name : str
        In files and on the command line.
    title : str
        In tables.
    fit : callable
        ``fit(data) -> Fitted`` from the fitted part of a record. What it raises is a result.
    suits : callable
        Whether it takes part on a record where nobody names it.
    """

    name: str
    title: str
    fit: Callable[[Dataset], Fitted]
    suits: Callable[[BenchmarkRecord], bool]
