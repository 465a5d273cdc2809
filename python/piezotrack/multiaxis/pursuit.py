"""Modes of a response of several axes, found one after the other, and refined together."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .gauss_newton import Target, refine
from .modal_terms import ModalTerms

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

__all__ = ["Pursued", "pursue"]

# Decays of the candidates, in distances of the lines: the least, their ratio, the largest per
# sample; and their distances, in decays.
NARROW, RATIO, WIDE, APART = 1.0, 2.0, 1.5, 1.5
# Most entries of the table of candidates.
MOST_ENTRIES = 12_000_000
# Steps after each new mode, and at the end.
STEPS, LAST_STEPS = 4, 40
TOLERANCE, LAST_TOLERANCE = 1e-3, 1e-5
# Reduction of the criterion for each unknown, in logarithms of the count of numbers, as of
# `fit_modes`; mean squared residual, in variances, below which nothing is gained; and modes
# without a gain after which the search ends.
PENALTY, GAINED, PATIENCE = 2.0, 0.1, 3


class Pursued(NamedTuple):
    """Modes that were found.

    Attributes
    ----------
    terms : ModalTerms
        The modes.
    criterion : ndarray, shape (n,)
        Criterion for 1, 2, ... modes; the least was taken.
    """

    terms: ModalTerms
    criterion: Array


def pursue(target: Target, expected: float, most: int, *, fixed: bool) -> Pursued:
    """Find modes one after the other.

    Each new mode is the one of many poles whose matrix of rank one takes most from the error that
    the others leave (orthogonal matching pursuit: Pati, Rezaiifar and Krishnaprasad 1993, doi
    10.1109/ACSSC.1993.342465); all modes are refined together after each.

    Parameters
    ----------
    target : Target
        Responses and weights.
    expected : float
        Weighted sum of squared errors that is expected of noise and distortion.
    most : int
        Most modes.
    fixed : bool
        Whether there are to be as many; by default the number for which the criterion of Schwarz
        is least, with twice its penalty.

    Returns
    -------
    Pursued
        The modes.
    """
    poles = _candidates(target)
    weight = np.sqrt(target.weight)[:, np.newaxis]
    table = np.asarray(weight / (target.z[:, np.newaxis] - poles), dtype=np.complex64)
    sizes = np.square(np.abs(table)).sum(axis=0).astype(np.float64)
    adjoint = np.ascontiguousarray(table.conj().T)
    del table
    count, sensors, drives = target.value.shape
    numbers = 2 * target.value.size
    terms = ModalTerms(
        np.empty(0, dtype=np.complex128),
        np.empty((0, drives), dtype=np.complex128),
        np.empty((0, sensors), dtype=np.complex128),
        np.einsum("k,kij->ij", target.weight, target.value).real / target.weight.sum(),
    )
    _, error = target.misfit(terms)
    best, criteria = terms, list[float]()
    for number in range(1, most + 1):
        weighted = (weight * error.reshape(count, -1)).astype(np.complex64)
        shares = (adjoint @ weighted).astype(np.complex128).reshape(-1, sensors, drives)
        taken = np.square(np.linalg.svd(shares, compute_uv=False)[:, 0]) / sizes
        place = int(np.argmax(taken))
        left, values, right = np.linalg.svd(shares[place] / sizes[place])
        terms = ModalTerms(
            np.append(terms.poles, _apart(poles[place], terms.poles)),
            np.vstack([terms.inputs, right[0]]),
            np.vstack([terms.outputs, left[:, 0] * values[0]]),
            terms.direct,
        )
        terms, cost, error = refine(target, terms, STEPS, TOLERANCE)
        unknowns = number * 2 * (drives + sensors) + drives * sensors
        criteria.append(
            numbers * np.log(cost / expected + GAINED) + PENALTY * unknowns * np.log(numbers)
        )
        if fixed or criteria[-1] <= min(criteria):
            best = terms
        elif number - 1 - int(np.argmin(criteria)) >= PATIENCE:
            break
    best, _, _ = refine(target, best, LAST_STEPS, LAST_TOLERANCE)
    order = np.argsort(np.abs(np.log(best.poles)), kind="stable")
    return Pursued(
        ModalTerms(best.poles[order], best.inputs[order], best.outputs[order], best.direct),
        np.array(criteria),
    )


def _candidates(target: Target) -> Complex:
    """Return poles of several decays all over the band."""
    angles = np.angle(target.z)
    first, last = float(angles[0]), float(angles[-1])
    distance = float(np.median(np.diff(angles)))
    # The poles of the narrowest are about as many as all others together.
    fewest = 2.0 * (last - first) / APART * angles.size / MOST_ENTRIES
    decay = max(NARROW * distance, fewest)
    found = []
    while decay < WIDE:
        reach = min(last + decay, 0.999 * np.pi)
        found.append(np.exp(-decay + 1j * np.arange(max(first, 0.5 * decay), reach, APART * decay)))
        decay *= RATIO
    return np.concatenate(found)


def _apart(pole: complex, others: Complex) -> complex:
    """Return a pole that is none of the others, with which it could not be told apart."""
    while others.size and np.abs(others - pole).min() < 1e-9:
        pole *= np.exp(1e-4j)
    return pole
