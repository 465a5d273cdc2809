"""Modes in parallel of a sampled system of several axes: response, state, interpolation."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from .. import _core

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]
    Pair = tuple[Array, Array]
    Found = tuple[Pair, Pair, Pair, Array]
    Parts = tuple[int, int, Pair, Pair, Pair, Array]

__all__ = ["ModalTerms"]

# Overlap of two shapes from which they are one mode; damping ratio from which a pole is none.
ALIKE, DAMPED = 0.5, 0.3


@dataclass(frozen=True, eq=False)
class ModalTerms:
    r"""Sampled modes of rank one in parallel.

    .. math:: G(z) = D + \sum_i \frac{c_i b_i^T}{z - p_i} + \frac{\bar c_i \bar b_i^T}
        {z - \bar p_i}, \qquad |p_i| < 1

    Attributes
    ----------
    poles : ndarray of complex, shape (q,)
        p, one of each conjugate pair; a pole on the real axis counts as a lag.
    inputs : ndarray of complex, shape (q, drives)
        b.
    outputs : ndarray of complex, shape (q, sensors)
        c [m/V].
    direct : ndarray, shape (sensors, drives)
        D [m/V].
    forces : ndarray of complex, shape (q, drives) or (q, drives + functions)
        e of the distortion, as of `choose_distortion`; empty where there is none.
    """

    poles: Complex
    inputs: Complex
    outputs: Complex
    direct: Array
    forces: Complex = field(default_factory=lambda: np.zeros((0, 0), dtype=np.complex128))

    @classmethod
    def _of(cls, found: Found, sensors: int, drives: int) -> ModalTerms:
        """Return the terms that the compiled core gives."""
        poles, inputs, outputs = (real + 1j * imaginary for real, imaginary in found[:3])
        return cls(
            poles,
            inputs.reshape(-1, drives),
            outputs.reshape(-1, sensors),
            found[3].reshape(sensors, drives),
        )

    def _parts(self) -> Parts:
        """Return the terms as the compiled core takes them."""
        sensors, drives = self.direct.shape
        poles, inputs, outputs = (
            (part.real.ravel(), part.imag.ravel())
            for part in (self.poles, self.inputs, self.outputs)
        )
        return drives, sensors, poles, inputs, outputs, self.direct.ravel()

    @property
    def residues(self) -> Complex:
        """Matrices c b^T of the modes, shape (q, sensors, drives)."""
        return np.asarray(self.outputs[:, :, np.newaxis] * self.inputs[:, np.newaxis, :])

    def response(self, z: Complex) -> Complex:
        """Return the response at points z, shape (points, sensors, drives)."""
        residues = self.residues
        points = z[:, np.newaxis]
        # Sums of einsum have one order, those of matrix products another for each thread count.
        found = np.einsum("kq,qij->kij", 1.0 / (points - self.poles), residues)
        found += np.einsum("kq,qij->kij", 1.0 / (points - self.poles.conj()), residues.conj())
        return np.asarray(found + self.direct)

    def balanced(self) -> ModalTerms:
        """Return the same with b and c of equal size, the largest b real, and poles above."""
        return ModalTerms._of(_core.balanced_terms(self._parts()), *self.direct.shape)

    def scaled(self, factor: float) -> ModalTerms:
        """Return the terms of a response that is larger by a factor."""
        return replace(self, outputs=factor * self.outputs, direct=factor * self.direct)

    def aligned(self, other: ModalTerms) -> tuple[Complex, Complex]:
        """Return b and c, turned and sized so that b is as near to that of others as it can."""
        turned = ModalTerms._of(
            _core.aligned_terms(self._parts(), other._parts()), *self.direct.shape
        )
        return turned.inputs, turned.outputs

    def between(self, other: ModalTerms, share: float) -> ModalTerms:
        """Return the terms a share of the way to others with the same modes.

        Logarithms of the poles, b, c, D and e are interpolated, b and c of `other` as of `aligned`.
        A term that is strongly damped or has another shape in both is no mode that moved: it is
        taken from both, by their shares.
        """

        def mixed(first: Complex, second: Complex) -> Complex:
            return np.asarray((1.0 - share) * first + share * second)

        overlap = np.sum(other.inputs.conj() * self.inputs, axis=1)
        crossed = np.abs(np.sum(other.outputs.conj() * self.outputs, axis=1) * overlap)
        mine, theirs = (_residue_sizes(one) for one in (self, other))
        same = crossed > ALIKE * mine * theirs
        for one in (self, other):
            logarithm = np.log(one.poles)
            same &= -logarithm.real < DAMPED * np.abs(logarithm)
        turned = other.aligned(self)
        b, c = (part[same] for part in turned)
        rest = ~same
        forces = self.forces
        if forces.size:
            # e changes with b.
            turn = np.sum(other.inputs.conj() * turned[0], axis=1)
            turn /= np.sum(np.square(np.abs(other.inputs)), axis=1)
            e = (turn[:, np.newaxis] * other.forces)[same]
            forces = np.concatenate([mixed(forces[same], e), forces[rest], other.forces[rest]])

        return ModalTerms(
            np.concatenate(
                [
                    np.exp(mixed(np.log(self.poles[same]), np.log(other.poles[same]))),
                    self.poles[rest],
                    other.poles[rest],
                ]
            ),
            np.concatenate([mixed(self.inputs[same], b), self.inputs[rest], other.inputs[rest]]),
            np.concatenate(
                [
                    mixed(self.outputs[same], c),
                    (1.0 - share) * self.outputs[rest],
                    share * other.outputs[rest],
                ]
            ),
            (1.0 - share) * self.direct + share * other.direct,
            forces,
        )

    @cached_property
    def core(self) -> _core.ModalSystem:
        """The system in the compiled core, which simulates it."""
        return _core.ModalSystem(*self._parts())

    def simulate(self, drive: Array, state: Complex) -> tuple[Array, Complex]:
        """Return outputs, shape (samples, sensors), and the state after a drive from a state."""
        sensors = self.direct.shape[0]
        found, real, imaginary = self.core.simulate((state.real, state.imag), drive.ravel())
        return found.reshape(-1, sensors), real + 1j * imaginary

    def steady(self, drive: Array) -> Complex:
        """Return the state at the start of a period of a drive that repeats for ever."""
        _, last = self.simulate(drive, np.zeros(self.poles.size, dtype=np.complex128))
        return np.asarray(last / (1.0 - self.poles ** len(drive)))


def _residue_sizes(terms: ModalTerms) -> Array:
    """Return the norms of c b^T of each mode."""
    sizes = np.linalg.norm(terms.inputs, axis=1) * np.linalg.norm(terms.outputs, axis=1)
    return np.asarray(sizes)
