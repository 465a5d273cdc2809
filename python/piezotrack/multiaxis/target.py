"""`Target`: a response of several axes with weights, to which the compiled core fits modes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .. import _core
from .modal_terms import ModalTerms

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .approximation import MultiAxisResponse

    Array = NDArray[np.float64]

__all__ = ["Target"]


class Target:
    """A response in a unit in which it is about 1, with a weight of each line.

    Parameters
    ----------
    response : MultiAxisResponse
        The response.
    scale : float
        Unit of the response [m/V].
    power : float
        Power of the inverse variance by which lines are weighted, beside the power of the drives.
    """

    def __init__(self, response: MultiAxisResponse, scale: float, power: float) -> None:
        lines, sensors, drives = response.value.shape
        weight = response.power * response.variance.mean(axis=(1, 2)) ** -power
        weight /= weight.mean()
        value = response.value / scale
        angles = np.minimum(2.0 * np.pi * response.frequency * response.dt, np.pi)
        self._fit = _core.ModalFit(
            drives, sensors, angles, (value.real.ravel(), value.imag.ravel()), weight
        )
        self._shape = (sensors, drives)
        self._variance = response.variance / scale**2
        self.numbers = 2 * lines * sensors * drives
        # Weighted sums of squares: errors that noise and distortion make expected, and the value.
        self.expected = float(np.einsum("k,kij->", weight, self._variance))
        self.size = float(np.einsum("k,kij->", weight, np.square(np.abs(value))))

    def misfit(self, terms: ModalTerms) -> float:
        """Return the weighted sum of squared errors that terms leave."""
        return self._fit.misfit(terms._parts())

    def pursue(self, most: int, *, fixed: bool) -> ModalTerms:
        """Find modes one after the other.

        Parameters
        ----------
        most : int
            Most modes.
        fixed : bool
            Whether there are to be as many; by default the number for which the criterion of
            Schwarz is least, with twice its penalty.

        Returns
        -------
        ModalTerms
            The modes, refined.
        """
        return ModalTerms._of(self._fit.pursue(self.expected, most, fixed), *self._shape)

    def refine(self, start: ModalTerms, *, held: float = 0.0) -> ModalTerms:
        """Return the terms of the least misfit near some.

        Parameters
        ----------
        start : ModalTerms
            The start.
        held : float, optional
            Price of a departure from the start by its scale, in mean expected errors of a number.

        Returns
        -------
        ModalTerms
            Where the descent ended.
        """
        price = held * self.expected / self.numbers
        return ModalTerms._of(self._fit.refine(start._parts(), price), *self._shape)

    def pole_deviations(self, terms: ModalTerms) -> tuple[Array, Array]:
        """Return standard deviations of logarithms of decays, and of angles, of the poles."""
        return self._fit.pole_deviations(terms._parts(), self._variance.ravel())
