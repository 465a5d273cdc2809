"""Errors of a model on cycles of records that it does not know, by amplitude and rate."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...data.checks.diagnostics import amplitudes, turns
from ..linearised.values import fitted_values, sizes_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ..fitted.identified_model import IdentifiedModel
    from ..linearised.sensitivity import Sensitivity

    Array = NDArray[np.float64]
    Places = NDArray[np.intp]

__all__ = ["HalfWidths", "HeldOut", "held_out"]

# Most cycles of a record, beyond which several are taken as one, and fewest of a class.
MOST, FEWEST = 200, 5
# Classes of amplitude, and of rate in each.
CLASSES = 3
# How far outside the range of the records a drive is still within it.
MARGIN = 1.05


class HalfWidths(NamedTuple):
    """Half widths of the band of a prediction.

    Attributes
    ----------
    noise, model_error : ndarray, shape (m,)
        By the noise, and by the error of the model: larger in proportion for amplitudes or rates
        above all of the records [m].
    unlike : ndarray of bool, shape (m,)
        Where the records have no such amplitude or rate.
    """

    noise: Array
    model_error: Array
    unlike: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldOut:
    """Errors of a model where it was not fitted.

    Attributes
    ----------
    errors : ndarray, shape (n,)
        Size of the error of each sample [m].
    amplitude, rate : ndarray, shape (n,)
        Amplitude [V] and size of the rate [V/s] of the drive there.
    cycle : ndarray of int, shape (n,)
        Number of the cycle of the drive, which was left out of the fit for its own errors.
    """

    errors: Array
    amplitude: Array
    rate: Array
    cycle: Places

    def cycles(self, kept: NDArray[np.bool_] | slice = slice(None)) -> int:
        """Count the cycles of which there are samples among some."""
        return int(np.unique(self.cycle[kept]).size)

    def quantile(self, level: float, kept: NDArray[np.bool_] | slice = slice(None)) -> float:
        """Return what the error of a new cycle stays below with a probability.

        Parameters
        ----------
        level : float
            The probability.
        kept : ndarray of bool, shape (n,), optional
            Samples that are used; all where not given.

        Returns
        -------
        float
            The quantile of the errors of cycles that were left out (Barber et al. 2021, doi
            10.1214/20-AOS1965), enlarged for few cycles as Student's t is, with the degrees of
            freedom of their mean squares (Satterthwaite 1946, doi 10.2307/3002019) [m].
        """
        from scipy.special import ndtri, stdtrit

        errors, cycle = self.errors[kept], self.cycle[kept]
        counts = np.bincount(cycle)
        squares = np.bincount(cycle, weights=errors**2)[counts > 0] / counts[counts > 0]
        enlarged = 1.0
        if squares.size > 1 and (spread := float(squares.var(ddof=1))) > 0.0:
            freedom = max(squares.size - 1.0, 2.0 * float(squares.mean()) ** 2 / spread)
            upper = 0.5 + 0.5 * level
            # Beyond a million the two do not differ.
            enlarged = float(stdtrit(min(freedom, 1e6), upper) / ndtri(upper))
        return enlarged * float(np.quantile(errors, level))

    def at(self, amplitude: Array, rate: Array, level: float, noise: float) -> HalfWidths:
        """Return what errors under another drive stay below with a probability.

        Parameters
        ----------
        amplitude, rate : ndarray, shape (m,)
            Of the drive.
        level : float
            The probability.
        noise : float
            Standard deviation of the noise, which is in the errors [m].

        Returns
        -------
        HalfWidths
            By the noise and by the error of the model.
        """
        by_noise, by_model = np.empty(amplitude.size), np.empty(amplitude.size)
        by_noise[:], by_model[:] = self._shared(slice(None), level, noise)
        for here, there in self._classes(self.amplitude, amplitude, None):
            for kept, placed in self._classes(self.rate, rate, (here, there)):
                use = next((one for one in (kept, here) if self.cycles(one) >= FEWEST), None)
                if use is not None:
                    by_noise[placed], by_model[placed] = self._shared(use, level, noise)
        above = np.maximum(
            amplitude / max(float(self.amplitude.max()), 1e-300),
            rate / max(float(self.rate.max()), 1e-300),
        )
        by_model *= np.where(above > MARGIN, above, 1.0)
        unlike = (above > MARGIN) | (amplitude * MARGIN < self.amplitude.min())
        return HalfWidths(by_noise, by_model, unlike)

    def _shared(
        self, kept: NDArray[np.bool_] | slice, level: float, noise: float
    ) -> tuple[float, float]:
        """Return the quantile of some errors, shared by noise and model as their mean square is."""
        power = float(np.mean(self.errors[kept] ** 2))
        share = min(noise**2 / power, 1.0) if power > 0.0 else 1.0
        size = self.quantile(level, kept)
        return size * math.sqrt(share), size * math.sqrt(1.0 - share)

    @staticmethod
    def _classes(
        known: Array, new: Array, within: tuple[NDArray[np.bool_], NDArray[np.bool_]] | None
    ) -> list[tuple[NDArray[np.bool_], NDArray[np.bool_]]]:
        """Return the samples of each class of a quantity, of the records and of another drive."""
        here, there = within or (np.ones(known.size, np.bool_), np.ones(new.size, np.bool_))
        if not here.any():
            return []
        shares = np.arange(1, CLASSES) / CLASSES
        ends = np.unique(np.quantile(known[here], shares))
        places = np.digitize(known, ends), np.digitize(new, ends)
        return [(here & (places[0] == k), there & (places[1] == k)) for k in range(ends.size + 1)]


def held_out(
    model: IdentifiedModel,
    records: Sequence[tuple[Dataset, float]],
    linear: Sequence[Sensitivity | None],
) -> HeldOut:
    r"""Find the errors of a model on each cycle of records, for a fit without that cycle.

    With the change X of the displacement with all that was fitted, values, offset and drift, the
    errors e of a cycle b become, for a fit that does not know it,

    .. math:: e_b + X_b (X^T X - X_b^T X_b)^{-1} X_b^T e_b

    which is exact for what is linear (Cook and Weisberg 1982, Residuals and influence in
    regression, section 3.6). Of a record that was not fitted they are what they are.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    records : sequence of (Dataset, float)
        The records with their weights.
    linear : sequence of Sensitivity or None
        Each record about the model; None of one that was not fitted.

    Returns
    -------
    HeldOut
        Of the readings that count. A record without a whole cycle is one, whose errors are those of
        the fit.
    """
    known = [
        _Record(model, data, weight, at) for (data, weight), at in zip(records, linear, strict=True)
    ]
    normal = _Normal(known, len(fitted_values(model)))
    first = np.cumsum([0, *(one.count for one in known)])
    return HeldOut(
        errors=np.abs(np.concatenate([normal.left(i) for i in range(len(known))])),
        amplitude=np.concatenate([one.amplitude for one in known]),
        rate=np.concatenate([one.rate for one in known]),
        cycle=np.concatenate([one.cycle + k for one, k in zip(known, first, strict=False)]),
    )


class _Record:
    """A record: its error, what was fitted to it, and the cycles of its drive."""

    def __init__(
        self,
        model: IdentifiedModel,
        data: Dataset,
        weight: float,
        linear: Sensitivity | None,
    ) -> None:
        data = data.without_faulty_readings()
        self.rate = np.abs(data.counted(np.gradient(data.u, data.dt)))
        self.amplitude = data.counted(amplitudes(data.u))
        # From every second turn of the drive to the next.
        ends = np.array(turns(data.u)[1::2], dtype=np.intp)
        ends = ends[:: -(-ends.size // MOST)] if ends.size else ends
        cycle = np.searchsorted(ends, np.arange(len(data)), side="right")
        self.cycle = np.unique(data.counted(cycle.astype(np.float64)), return_inverse=True)[1]
        self.count = int(self.cycle.max()) + 1
        self.fitted = linear is not None
        if linear is None:
            self.error = np.asarray(data.counted(data.y - model.simulate(data).x))
            return
        sizes = sizes_of(model, fitted_values(model), data.dt)
        self.error = math.sqrt(weight) * linear.residual
        lengths = np.linalg.norm(linear.nuisance, axis=1, keepdims=True)
        self.columns = math.sqrt(weight) * (linear.columns * sizes[:, None]).T
        self.nuisance = (linear.nuisance / np.where(lengths > 0.0, lengths, 1.0)).T
        self.sizes = linear.sizes * lengths[:, 0]
        self.weight = weight


class _Normal:
    """Normal equations of all records that were fitted."""

    def __init__(self, records: Sequence[_Record], count: int) -> None:
        self.records, self.count = records, count
        fitted = [one for one in records if one.fitted]
        widths = [one.nuisance.shape[1] if one.fitted else 0 for one in records]
        self.first = count + np.cumsum([0, *widths])
        self.products = np.zeros((int(self.first[-1]), int(self.first[-1])))
        for i, one in enumerate(records):
            if one.fitted:
                places, columns = self._of(i)
                self.products[np.ix_(places, places)] += columns.T @ columns
        # A value is known to within its own size, however little a cycle says of it, as is what
        # belongs to a record: a drift that is over in one cycle would be unlimited there.
        squares = [float(np.mean(one.error**2)) for one in fitted]
        ridge = np.full(self.products.shape[0], 1e-12)
        # Of a record without noise, not below what rounding leaves of the products.
        size = self.products.shape[0] * float(np.max(np.diagonal(self.products), initial=0.0))
        least = max([*squares, np.finfo(np.float64).eps * size])
        ridge[:count] = least
        for first, one in zip(self.first, records, strict=False):
            if one.fitted:
                own = slice(first, first + one.sizes.size)
                # What has no effect on the record is held at 0 by a finite weight.
                ridge[own] += one.weight / np.maximum(one.sizes / math.sqrt(least), 1e-8) ** 2
        self.products += np.diag(ridge)

    def _of(self, i: int) -> tuple[Places, Array]:
        """Places of the values and of what belongs to a record, and their columns there."""
        one = self.records[i]
        own = np.arange(self.first[i], self.first[i + 1])
        return np.append(np.arange(self.count), own), np.hstack([one.columns, one.nuisance])

    def left(self, i: int) -> Array:
        """Errors of a record, of each cycle for a fit without it [m]."""
        one = self.records[i]
        if not one.fitted or one.count < 2:
            return one.error
        places, columns = self._of(i)
        left = np.empty_like(one.error)
        for cycle in range(one.count):
            here = one.cycle == cycle
            normal, moved = self.products.copy(), np.zeros(self.products.shape[0])
            normal[np.ix_(places, places)] -= columns[here].T @ columns[here]
            moved[places] = columns[here].T @ one.error[here]
            left[here] = one.error[here] + columns[here] @ np.linalg.solve(normal, moved)[places]
        return np.asarray(left / math.sqrt(one.weight))
