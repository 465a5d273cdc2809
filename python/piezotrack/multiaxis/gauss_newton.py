"""Weighted least squares of modal terms on responses: Gauss-Newton with damped steps.

The Jacobian is never formed. Every derivative of the model is a constant matrix of rank one or two
times one of 4 q + 1 functions of frequency, 1/(z - p), its square, those of the conjugate, and 1:
normal equations follow from the inner products of these functions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from .modal_terms import ModalTerms

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]
    Places = NDArray[np.intp]

__all__ = ["Target", "pole_deviations", "refine"]

# Damping: at the start, least, and factors after a step that helped and one that did not.
DAMPING, LEAST, DOWN, UP = 1e-3, 1e-8, 0.2, 10.0
TRIES = 14
# Largest step of the logarithm of a decay, and of an angle in decays.
DECAY, TURN = 0.7, 2.0
# Least decay of a pole per sample, in distances of the lines: narrower modes are not seen. Outside
# the band it is the distance from the band too.
NARROWEST = 0.2
# What a step of a pole by its scale costs at least, relative to the misfit: poles that the
# response does not show stay where they are.
HELD = 1e-6
# Scale of a departure: of the logarithm of a decay, and of b and c relative to their size; that of
# an angle is the decay.
FREE = 0.3
# Eigenvalues of the scaled normal equations, relative to the largest, that are directions of
# the gauge.
GAUGE = 1e-10


@dataclass(frozen=True, eq=False)
class Target:
    """Responses that are fitted, with weights, in a unit in which they are about 1.

    Attributes
    ----------
    z : ndarray of complex, shape (k,)
        Points of the unit circle.
    value : ndarray of complex, shape (k, sensors, drives)
        Responses.
    weight : ndarray, shape (k,)
        Weights of the lines, 1 on average.
    """

    z: Complex
    value: Complex
    weight: Array

    @cached_property
    def _ends(self) -> tuple[float, float, float]:
        angles = np.angle(self.z)
        least = NARROWEST * float(np.median(np.diff(angles)))
        return least, float(angles[0]), float(angles[-1])

    def narrowest(self, angles: Array) -> Array:
        """Return the least decay per sample of poles at some angles."""
        least, first, last = self._ends
        angles = np.abs(np.angle(np.exp(1j * angles)))
        return np.maximum(least, np.maximum(first - angles, angles - last))

    def misfit(self, terms: ModalTerms) -> tuple[float, Complex]:
        """Return the weighted sum of squared errors, and the errors."""
        error = self.value - terms.response(self.z)
        squares = np.square(error.real) + np.square(error.imag)
        return float(np.einsum("k,kij->", self.weight, squares)), error


def refine(
    target: Target,
    terms: ModalTerms,
    iterations: int,
    tolerance: float,
    *,
    held: float = 0.0,
) -> tuple[ModalTerms, float, Complex]:
    """Descend from some terms.

    Parameters
    ----------
    target : Target
        Responses and weights.
    terms : ModalTerms
        The start.
    iterations : int
        Most steps.
    tolerance : float
        Relative reduction of the misfit below which the descent ends.
    held : float, optional
        Price of a departure from the start by its scale, in the unit of the misfit: directions that
        the response does not show stay there, so that the modes remain the same ones.

    Returns
    -------
    terms, misfit, error
        Where it ended, as of `Target.misfit`.
    """
    terms = terms.balanced()
    start = terms
    cost, error = target.misfit(terms)
    damping = DAMPING
    for _ in range(iterations):
        normal, slope = _normal_equations(target, terms, error)
        before = cost
        if held:
            distance, size = _departure(start, terms)
            normal += np.diag(held / np.square(size))
            slope -= held * distance / np.square(size)
            before += held * float(np.sum(np.square(distance / size)))
        decay = -np.log(np.abs(terms.poles))
        modes = terms.poles.size
        least = np.zeros(slope.size)
        least[:modes] = HELD * cost
        least[modes : 2 * modes] = HELD * cost / np.square(decay)
        scale = np.sqrt(np.diag(normal) + least)
        scale[scale == 0.0] = 1.0
        normal /= np.outer(scale, scale)
        slope /= scale
        for _ in range(TRIES):
            step = np.linalg.solve(normal + damping * np.eye(slope.size), slope) / scale
            moved = _moved(target, terms, step)
            left, rest = target.misfit(moved)
            reached = left
            if held:
                distance, size = _departure(start, moved)
                reached += held * float(np.sum(np.square(distance / size)))
            if reached < before:
                break
            damping *= UP
        else:
            break
        gained = (before - reached) / before
        terms, cost, error = moved.balanced(), left, rest
        damping = max(DOWN * damping, LEAST)
        if gained < tolerance:
            break
    return terms, cost, error


def _departure(start: ModalTerms, terms: ModalTerms) -> tuple[Array, Array]:
    """Return how far the unknowns are from a start, and their scales, infinite for D."""
    b, c = start.aligned(terms)
    decay = -np.log(np.abs(start.poles))
    slower = np.log(np.log(np.abs(terms.poles)) / np.log(np.abs(start.poles)))
    turned = np.angle(terms.poles / start.poles)
    parts, sizes = [slower, turned], [np.full(decay.size, FREE), decay]
    for mine, own in ((terms.outputs, c), (terms.inputs, b)):
        away = (mine - own).ravel()
        size = FREE * np.repeat(np.linalg.norm(own, axis=1), own.shape[1])
        parts += [away.real, away.imag]
        sizes += [size, size]
    count = terms.direct.size
    return (
        np.concatenate([*parts, np.zeros(count)]),
        np.concatenate([*sizes, np.full(count, np.inf)]),
    )


def pole_deviations(target: Target, terms: ModalTerms, variance: Array) -> Array:
    """Return the standard deviations of the logarithms of decays, and of the angles, of the poles.

    They are those of least squares with these weights under errors of the given variance
    (Pintelon and Schoukens 2012, section 9.5), larger by the misfit where the model leaves more.

    Parameters
    ----------
    target : Target
        Responses and weights.
    terms : ModalTerms
        The minimum.
    variance : ndarray, shape (k, sensors, drives)
        Expectation of the squared errors of the responses.

    Returns
    -------
    ndarray, shape (2, modes)
        Of decays and of angles.
    """
    cost, error = target.misfit(terms)
    normal, _ = _normal_equations(target, terms, error)
    spread, _ = _normal_equations(
        target, terms, error, np.square(target.weight)[:, np.newaxis, np.newaxis] * 0.5 * variance
    )
    expected = float(np.einsum("k,kij->", target.weight, variance))
    scale = np.sqrt(np.diag(normal))
    scale[scale == 0.0] = 1.0
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    kept = values > GAUGE * values[-1]
    half = vectors[:, kept] / values[kept]
    inverse = half @ vectors[:, kept].T / np.outer(scale, scale)
    covariance = inverse @ spread @ inverse * max(1.0, cost / expected)
    modes = terms.poles.size
    return np.sqrt(np.maximum(np.diag(covariance)[: 2 * modes], 0.0)).reshape(2, modes)


def _moved(target: Target, terms: ModalTerms, step: Array) -> ModalTerms:
    """Return terms after a step of all unknowns, those of the poles limited."""
    modes, (sensors, drives) = terms.poles.size, terms.direct.shape
    cuts = np.cumsum([modes, modes, *2 * [modes * sensors], *2 * [modes * drives]])
    slower, turned, *parts, direct = np.split(step, cuts)
    decay = -np.log(np.abs(terms.poles))
    angles = np.angle(terms.poles) + np.clip(turned, -TURN * decay, TURN * decay)
    decay = np.maximum(decay * np.exp(np.clip(slower, -DECAY, DECAY)), target.narrowest(angles))
    poles = np.exp(-decay + 1j * angles)
    c, b = ((parts[k] + 1j * parts[k + 1]).reshape(modes, -1) for k in (0, 2))
    return ModalTerms(
        poles, terms.inputs + b, terms.outputs + c, terms.direct + direct.reshape(sensors, drives)
    )


def _derivatives(terms: ModalTerms) -> tuple[Complex, Places, Places]:
    """Return, for each unknown, a matrix, the function it goes with, and that of its conjugate.

    The derivative of the response is M f + conj(M) g. The unknowns are logarithms of decays,
    angles, real and imaginary parts of c and of b, and D.
    """
    modes, (sensors, drives) = terms.poles.size, terms.direct.shape
    residues = terms.residues
    shift = (terms.poles * np.log(np.abs(terms.poles)))[:, np.newaxis, np.newaxis] * residues
    turn = (1j * terms.poles)[:, np.newaxis, np.newaxis] * residues
    rows = np.eye(sensors)[np.newaxis, :, :, np.newaxis] * terms.inputs[:, np.newaxis, np.newaxis]
    columns = (
        np.eye(drives)[np.newaxis, :, np.newaxis] * terms.outputs[:, np.newaxis, :, np.newaxis]
    )
    c = rows.reshape(-1, sensors, drives)
    b = columns.reshape(-1, sensors, drives)
    size = sensors * drives
    d = 0.5 * np.eye(size).reshape(size, sensors, drives)
    matrices = np.concatenate([shift, turn, c, 1j * c, b, 1j * b, d]).reshape(-1, size)
    each = np.arange(modes)
    above = np.concatenate(
        [
            np.tile(2 * modes + each, 2),
            np.tile(np.repeat(each, sensors), 2),
            np.tile(np.repeat(each, drives), 2),
            np.full(size, 4 * modes),
        ]
    )
    below = np.where(above == 4 * modes, above, above + modes)
    return matrices, above, below


def _normal_equations(
    target: Target, terms: ModalTerms, error: Complex, weight: Array | None = None
) -> tuple[Array, Array]:
    """Return the normal matrix of the unknowns and the negative gradient.

    `weight`, shape (k, sensors, drives), is in place of the weights of the lines.
    """
    matrices, above, below = _derivatives(terms)
    z = target.z[:, np.newaxis]
    up, down = 1.0 / (z - terms.poles), 1.0 / (z - terms.poles.conj())
    functions = np.hstack([up, down, up * up, down * down, np.ones_like(z)])
    if weight is None:
        functions *= np.sqrt(target.weight)[:, np.newaxis]
        products = functions.conj().T @ functions
        same = matrices.conj() @ matrices.T
        crossed = matrices.conj() @ matrices.conj().T
        normal = (
            products[np.ix_(above, above)] * same
            + products[np.ix_(above, below)] * crossed
            + products[np.ix_(below, above)] * crossed.conj()
            + products[np.ix_(below, below)] * same.conj()
        ).real
        weighted = np.sqrt(target.weight)[:, np.newaxis] * error.reshape(len(error), -1)
        slopes = functions.conj().T @ weighted
        slope = (matrices.conj() * slopes[above] + matrices * slopes[below]).sum(axis=1).real
        return np.ascontiguousarray(normal), np.ascontiguousarray(slope)
    normal = np.zeros((above.size, above.size))
    flat = weight.reshape(len(weight), -1)
    for entry in range(flat.shape[1]):
        products = functions.conj().T @ (flat[:, entry, np.newaxis] * functions)
        column = matrices[:, entry]
        used = np.flatnonzero(column)
        a, f, g = column[used], above[used], below[used]
        same, crossed = np.outer(a.conj(), a), np.outer(a.conj(), a.conj())
        normal[np.ix_(used, used)] += (
            products[np.ix_(f, f)] * same
            + products[np.ix_(f, g)] * crossed
            + products[np.ix_(g, f)] * crossed.conj()
            + products[np.ix_(g, g)] * same.conj()
        ).real
    return normal, np.zeros(above.size)
