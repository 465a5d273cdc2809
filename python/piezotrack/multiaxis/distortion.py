"""Distortion of several axes: nonlinear functions of drives and elongations that act on modes."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .. import _core
from .approximation import smoothed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from .approximation import MultiAxisResponse
    from .modal_terms import ModalTerms
    from .record import MultiAxisRecord

    Array = NDArray[np.float64]
    Complex = NDArray[np.complex128]

__all__ = ["Distortion", "ModalForce", "Regressors", "choose_distortion", "simulate_distorted"]

# Thresholds of stop operators, and the change of a drive per sample at which half of its saturation
# is reached, in levels.
DRIVE_STOPS, ELONGATION_STOPS, CHANGE = (0.5, 1.5), (0.4,), 1.0
# Most unknowns, of modes times candidates, that are compared.
MOST_COLUMNS = 3000
# Powers of the level, of records at several and at one.
POWERS, POWER_OF_ONE = (0, 1, 2, 3), (1,)
# Most forces.
MOST = 600
# Power of the residual's variance by which lines are weighted: half way between equal weights, for
# the displacement, and those of the largest likelihood.
POWER = 0.5
# Residual, relative to the displacement, below which the modes describe all there is.
LEAST = 1e-5
# Neighbours on each side over which the variance is averaged.
BESIDE = 40


@dataclass(frozen=True)
class Regressors:
    r"""Functions of the drives and of the elongations of actuators, relative to the level.

    Variables 0 to n - 1 are the n drives, n to 2 n - 1 the elongations in volts: the inverse of the
    gains at rest times the displacements of the modes.

    Attributes
    ----------
    products : tuple of tuple of int
        Variables that are multiplied.
    stops : tuple of (int, float)
        Variable and threshold of stop operators.
    changes : tuple of (int, float)
        Variable and scale of changes since the sample before, saturated: :math:`d / (s + |d|)`.
    """

    products: tuple[tuple[int, ...], ...] = ()
    stops: tuple[tuple[int, float], ...] = ()
    changes: tuple[tuple[int, float], ...] = ()

    @classmethod
    def candidates(cls, drives: int, modes: int) -> Regressors:
        """Return those that are tried: fewer where there are many modes and drives."""
        u, q = range(drives), range(drives, 2 * drives)
        own = [(u[k], q[k]) for k in range(drives)]
        stops = [*itertools.product(u, DRIVE_STOPS), *itertools.product(q, ELONGATION_STOPS)]
        changes = tuple((k, CHANGE) for k in u)
        pairs, triples = itertools.combinations_with_replacement, [(k,) * 3 for k in u]
        every = cls((*pairs((*u, *q), 2), *pairs(q, 3), *triples), tuple(stops), changes)
        if 2 * modes * (drives + len(every)) <= MOST_COLUMNS:
            return every
        within = (product for axis in own for product in pairs(axis, 2))
        return cls((*within, *((k,) * 3 for k in (*u, *q))), tuple(stops), changes)

    def __len__(self) -> int:
        return len(self.products) + len(self.stops) + len(self.changes)

    def only(self, kept: Sequence[int]) -> Regressors:
        """Return some of them, in rising order."""
        parts = []
        first = 0
        for part in (self.products, self.stops, self.changes):
            parts.append(tuple(one for k, one in enumerate(part, first) if k in kept))
            first += len(part)
        return Regressors(*parts)  # type: ignore[arg-type]

    def core(self, terms: ModalTerms, level: float) -> _core.Regressors:
        """Return the regressors in the compiled core, at a level of the drives."""
        sensors, drives = terms.direct.shape
        gains = terms.response(np.ones(1, dtype=np.complex128))[0].real
        matrix = np.zeros((2 * drives, drives + sensors))
        matrix[:drives, :drives] = np.eye(drives)
        matrix[drives:, drives:] = np.linalg.pinv(gains)
        return _core.Regressors(
            drives, sensors, (matrix / level).ravel(), self.products, self.stops, self.changes
        )


class ModalForce(NamedTuple):
    """Force of a nonlinear function on a mode.

    Attributes
    ----------
    mode : int
        The mode.
    regressor : int
        The function.
    power : int
        Power of the level.
    value : complex
        Its part of e at the reference level, divided by that.
    """

    mode: int
    regressor: int
    power: int
    value: complex


@dataclass(frozen=True)
class Distortion:
    r"""Nonlinear functions that act on modes, the same at all levels.

    Beside the drives, mode i answers to functions n of drives and elongations by

    .. math:: e_{ij}(L) = \sum_{f} L_0 (L / L_0)^{p_f} v_f

    with the level L, the root mean square of the drives, the reference level :math:`L_0`, and the
    forces f on mode i of function j. Beyond the levels of the records forces grow with the level
    above them, and stay below them.

    Attributes
    ----------
    regressors : Regressors
        The functions.
    forces : tuple of ModalForce
        Powers p and values v.
    reference : float
        The level :math:`L_0` [V].
    levels : (float, float)
        The least and the largest level of the records [V].
    """

    regressors: Regressors = field(default_factory=Regressors)
    forces: tuple[ModalForce, ...] = ()
    reference: float = 1.0
    levels: tuple[float, float] = (1.0, 1.0)

    def __len__(self) -> int:
        return len(self.forces)

    def on(self, terms: ModalTerms, level: float) -> ModalTerms:
        """Return modes whose forces of the drives are followed by those of the functions."""
        if not self:
            return terms
        low, high = self.levels
        grown = max(level / high, 1.0) * self.reference
        ratio = min(max(level, low), high) / self.reference
        acting = np.zeros((terms.poles.size, len(self.regressors)), dtype=np.complex128)
        for mode, regressor, power, value in self.forces:
            acting[mode, regressor] += grown * ratio**power * value
        return replace(terms, forces=np.hstack([terms.forces, acting]))


def simulate_distorted(
    terms: ModalTerms,
    distortion: Distortion,
    level: float,
    drive: Array,
    state: Complex | None,
    *,
    periodic: bool = False,
) -> tuple[Array, Complex]:
    """Simulate modes with their distortion.

    Parameters
    ----------
    terms : ModalTerms
        The modes with all their forces.
    distortion : Distortion
        Of which functions they are.
    level : float
        Root mean square of the drives [V].
    drive : ndarray, shape (samples, drives)
        Drives about their operating point [V].
    state : ndarray of complex or None
        That of another simulation; at rest where there is none.
    periodic : bool, optional
        Whether the drives repeat for ever; there is no state then.

    Returns
    -------
    y : ndarray, shape (samples, sensors)
        Displacements about the operating point [m].
    state : ndarray of complex, shape (2 modes + 2 drives + functions,)
        States of the modes, of what the forces move, and of the functions.
    """
    modes, drives = terms.poles.size, drive.shape[1]
    regressors = distortion.regressors
    if state is None:
        state = np.zeros(2 * modes + 2 * drives + len(regressors), dtype=np.complex128)
    first, second, memory = np.split(state, (modes, 2 * modes))
    last, values = np.split(memory.real, (2 * drives,))
    # Below the least level products shrink; above the largest they keep their share.
    core = _core.DistortedModes(
        terms.core,
        regressors.core(terms, max(level, distortion.levels[0])),
        (terms.forces.real.ravel(), terms.forces.imag.ravel()),
    )

    def run() -> tuple[Array, Any]:
        parts = (first.real, first.imag), (second.real, second.imag), (last, values)
        return core.simulate(parts, drive.ravel())

    if periodic:
        first = terms.steady(drive)
        _, (_, _, (last, values)) = run()
        _, (_, (real, imaginary), _) = run()
        second = (real + 1j * imaginary) / (1.0 - terms.poles ** len(drive))
    y, (one, other, memory) = run()
    states = [real + 1j * imaginary for real, imaginary in (one, other)]
    return y.reshape(len(drive), -1), np.concatenate([*states, *memory])


def choose_distortion(
    records: Sequence[MultiAxisRecord],
    responses: Sequence[MultiAxisResponse],
    terms: Sequence[ModalTerms],
    *,
    most: int = MOST,
) -> tuple[Distortion, list[ModalTerms], list[float]]:
    r"""Choose the distortion that records show beyond the modes.

    Mode i answers to functions n, and to the drives so that no part linear in them is left, by

    .. math:: w_i[k + 1] = p_i w_i[k] + e_i \cdot (u[k], n[k])

    which adds :math:`2 \Re \sum c_i w_i` to the displacements: a polynomial nonlinear state-space
    model (Paduart and others 2010, doi 10.1016/j.automatica.2010.01.001) whose nonlinear functions
    follow from the linear motion, and so is stable. Forces, each of a function on a mode with a
    power of the level, are chosen one after the other by the criterion of Schwarz (1978, doi
    10.1214/aos/1176344136), with twice its penalty.

    Parameters
    ----------
    records : sequence of MultiAxisRecord
        Of each level.
    responses : sequence of MultiAxisResponse
        Their best linear approximations.
    terms : sequence of ModalTerms
        The modes at each level.
    most : int, optional
        Most forces, of two real numbers each.

    Returns
    -------
    distortion : Distortion
        Functions and forces; none where nothing was chosen.
    terms : list of ModalTerms
        The modes, with b as near to each other as they can, and forces of the drives.
    left : list of float
        Rms of the residual with them at each level, relative to that without.
    """
    drives, modes = records[0].drives, terms[0].poles.size
    candidates = Regressors.candidates(drives, modes)
    none = Distortion(), list(terms), [1.0] * len(terms)
    columns = 2 * modes * (drives + len(candidates))
    if columns > MOST_COLUMNS or any(_too_few(one, modes) for one in records):
        return none
    middle = terms[len(terms) // 2]
    alike = []
    for one in terms:
        inputs, outputs = one.aligned(middle)
        alike.append(replace(one, inputs=inputs, outputs=outputs))
    parts = zip(records, responses, alike, strict=True)
    levels, shares = zip(*(_level(*part, candidates) for part in parts), strict=True)
    if max(shares) < LEAST:
        return none
    reference = records[len(records) // 2].level
    powers = POWERS if len(records) > 1 else POWER_OF_ONE
    given = [
        (*level, [reference * (record.level / reference) ** power for power in powers])
        for level, record in zip(levels, records, strict=True)
    ]
    chosen, linear, left = _core.choose_distortion(given, drives, most)
    if not chosen:
        return none
    kept = sorted({place - drives for _, place, *_ in chosen})
    forces = tuple(
        ModalForce(mode, kept.index(place - drives), powers[power], complex(real, imaginary))
        for mode, place, power, real, imaginary in chosen
    )
    found = []
    for one, values in zip(alike, linear, strict=True):
        numbers = np.array(values).reshape(modes, drives, 2)
        found.append(replace(one, forces=numbers[..., 0] + 1j * numbers[..., 1]))
    ends = records[0].level, records[-1].level
    distortion = Distortion(candidates.only(kept), forces, reference, ends)
    return distortion, found, np.sqrt(left).tolist()


def _too_few(record: MultiAxisRecord, modes: int) -> bool:
    """Whether a record has not enough numbers for what is linear in the drives."""
    numbers = 2 * record.lines().size * record.sensors * record.realisations
    return numbers < 8 * modes * record.drives


def _level(
    record: MultiAxisRecord,
    response: MultiAxisResponse,
    terms: ModalTerms,
    candidates: Regressors,
) -> tuple[Any, float]:
    """Return spectra of the candidates and of the residual with weights, and its relative size."""
    lines = record.lines()
    u, measured = record.u.mean(axis=3), record.y.mean(axis=3)
    u, measured = (np.ascontiguousarray(one - one.mean(axis=0)) for one in (u, measured))
    core = candidates.core(terms, record.level)
    inputs, residual = [], []
    for r in range(record.realisations):
        drive = np.ascontiguousarray(u[:, :, r])
        y, _ = terms.simulate(drive, terms.steady(drive))
        _, last, values = core.follow(drive.ravel(), y.ravel())
        found, _, _ = core.follow(drive.ravel(), y.ravel(), (last, values))
        inputs.append(_lines(np.hstack([drive, found.reshape(len(drive), -1)]), lines))
        residual.append(_lines(measured[:, :, r] - y, lines))
    x, e = (np.stack(one, axis=2) for one in (inputs, residual))
    size = float(np.sqrt(np.mean(np.square(np.abs(e)))))
    share = size / float(np.sqrt(np.mean(np.square(np.abs(_lines(measured, lines))))))
    scale = size or 1.0
    if response.noise is not None and response.distortion is not None:
        # Realisations count less where they are noisier.
        distortion = response.distortion[:, :, np.newaxis]
        quiet = np.sqrt((distortion / (distortion + response.noise)).mean(axis=1))
        x, e = (one * quiet[:, np.newaxis] for one in (x, e))
    power = smoothed(np.square(np.abs(e) / scale).mean(axis=2), BESIDE)
    weights = np.maximum(power, 1e-12 * power.max() or 1.0) ** -POWER
    angles = 2.0 * np.pi * lines / record.samples
    e /= scale
    level = (
        terms.scaled(1.0 / scale)._parts(),
        angles,
        (x.real.ravel(), x.imag.ravel()),
        (e.real.ravel(), e.imag.ravel()),
        weights.ravel(),
    )
    return level, share


def _lines(signals: Array, lines: NDArray[np.intp]) -> Complex:
    return np.asarray(np.fft.rfft(signals, axis=0)[lines] * (2.0 / len(signals)))
