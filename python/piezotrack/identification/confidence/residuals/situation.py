"""A fit on a record: what its parameters can do there, and what one more regressor explains."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ....errors import PiezotrackError
from ....stages.plays.prandtl_ishlinskii import PrandtlIshlinskiiStage
from ....stages.plays.rate_dependent_prandtl_ishlinskii import RateDependentPrandtlIshlinskiiStage

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from ....data.dataset import Dataset
    from ...fitted.identification import Identification
    from ...fitted.start import History

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

__all__ = ["Explained", "Situation", "autocorrelation", "criterion", "independent_samples"]

# Share of its value by which a parameter is changed to see its effect.
STEP = 1e-3
# Singular values below this share of the largest are not used.
RANK, SMALL = 1e-9, 1e-6
# Values of a model whose effects are all taken; of more, those that were fitted and are not 0.
MOST_VALUES = 64
# Plays of the drive: at most so many, a play for so many samples, the closer the narrower.
PLAYS, SAMPLES, BENDS = 28, 60, 1.3


class Explained(NamedTuple):
    """Part of a residual that one more group of regressors explains.

    Attributes
    ----------
    left : ndarray, shape (n,)
        The residual that remains at the samples that count [m].
    fitted : int
        Values that were fitted: coefficients, time constants, frequencies.
    detail : str
        The values in words.
    added : ndarray, shape (m,)
        What it adds to the motion in warm-up and window [m].
    """

    left: Array
    fitted: int
    detail: str
    added: Array

    @property
    def squares(self) -> float:
        """Sum of the squares that remain [m^2]."""
        return float(self.left @ self.left)


@dataclass(frozen=True, kw_only=True)
class Situation:
    """A fit on one record: the residual, and the motion around it.

    Attributes
    ----------
    fit : Identification
        The fit.
    data : Dataset
        The record as it was fitted.
    rest : ndarray, shape (n,)
        Measured less simulated displacement in the window [m].
    kept : ndarray of bool, shape (n,)
        Samples that count.
    moved : bool
        Whether the stage moved before the record, as the fit has it.
    """

    fit: Identification
    data: Dataset
    rest: Array
    kept: Mask
    moved: bool

    @cached_property
    def x(self) -> Array:
        """Displacement of the model in warm-up and window [m]."""
        return self.fit.simulate(self.data.full, offset=0.0).x

    @cached_property
    def period(self) -> float:
        """Period of a sine of the drive's rate and size [s]."""
        u = self.data.u
        rate = float(np.sqrt(np.mean(np.diff(u) ** 2))) / self.data.dt
        return 2.0 * np.pi * float(u.std()) / rate

    @cached_property
    def drive(self) -> Array:
        """Drive of warm-up and window, from -1 to 1."""
        u = self.data.full.u
        scaled: Array = 2.0 * (u - u.min()) / np.ptp(u) - 1.0
        return scaled

    @cached_property
    def own(self) -> Array:
        """Orthonormal columns of what parameters and offset of the model do, where it counts."""
        return self.at(self._spanning(self._columns))

    @cached_property
    def effects(self) -> Array:
        """Columns of what these and any loop of point symmetry do, at warm-up and window."""
        return self._spanning(np.column_stack([self._columns, *self._symmetric()]))

    @cached_property
    def base(self) -> Array:
        """The effects at the samples that count, orthonormal."""
        return self.at(self.effects)

    @cached_property
    def null(self) -> Array:
        """The residual without the effects, at the samples that count [m]."""
        return self.free(self.rest[self.kept])

    def at(self, values: Array) -> Array:
        """Return the part of values of warm-up and window at the samples that count."""
        part: Array = values[self.data.warmup :][self.kept]
        return part

    def free(self, columns: Array) -> Array:
        """Return columns without the effects."""
        return columns - self.base @ (self.base.T @ columns)

    def freed(self, columns: list[Array]) -> tuple[Array, Array]:
        """Free columns of the effects, where it counts; they are scaled, by the second value."""
        matrix = np.stack([self.at(one) for one in columns], axis=1)
        size = np.linalg.norm(matrix, axis=0)
        size[size == 0.0] = 1.0
        free = self.free(matrix / size)
        # Of what the effects can do themselves rounding errors are left.
        free[:, np.linalg.norm(free, axis=0) < SMALL] = 0.0
        return free, size

    def explained(self, columns: list[Array], count: int, detail: str = "") -> Explained:
        """Fit columns over warm-up and window to the residual."""
        free, size = self.freed(columns)
        weights = np.linalg.lstsq(free, self.null, rcond=SMALL)[0]
        added = np.stack(columns, axis=1) @ (weights / size)
        return Explained(self.null - free @ weights, count, detail, added)

    def through(self, change: Callable[[Array], Array], count: int, detail: str) -> Explained:
        """Fit the effects again, with all of the motion changed by a linear filter."""
        added = change(self.x) - self.x
        columns = self.at(change(self.effects))
        left = self.rest[self.kept] - self.at(added)
        gram = columns.T @ columns
        gram[np.diag_indices_from(gram)] *= 1.0 + SMALL**2
        weights = np.linalg.solve(gram, columns.T @ left)
        return Explained(left - columns @ weights, count, detail, added)

    def beside(self, group: Explained) -> Array:
        """Motion of the model beside an ingredient, its parameters adjusted again [m]."""
        left = self.rest[self.kept] - self.at(group.added)
        return self.x + self.effects @ (self.base.T @ left)

    def alone(self, group: Explained) -> float:
        """Share of the residual that an ingredient explains with the model's own parameters."""
        column, rest = self.at(group.added), self.rest[self.kept]
        column, rest = (one - self.own @ (self.own.T @ one) for one in (column, rest))
        product = float(column @ column) * float(rest @ rest)
        return float(column @ rest) ** 2 / product if product > 0.0 else 0.0

    def play(self, u: Array, threshold: float, dilation: float = 0.0) -> Array:
        """Play of a signal from -1 to 1 less the signal; with a dilation what that adds to it.

        It begins where the first run through the signal ends, if the stage moved before.
        """
        plain = PrandtlIshlinskiiStage(linear=1.0, thresholds=(threshold,), weights=(1.0,))
        begin = plain.equilibrium(float(u[0]))
        if self.moved:
            begin = plain.simulate(np.append(u, u[0]), 1.0).final
        play: Array = plain.simulate(u, 1.0, hold=self.data.hold, initial=begin).x
        if not dilation:
            return play - u
        moving = RateDependentPrandtlIshlinskiiStage(
            linear=1.0, thresholds=(threshold,), weights=(1.0,), dilation=dilation
        )
        dilated: Array = moving.simulate(u, 1.0, hold=self.data.hold, initial=begin).x
        return dilated - play

    def _symmetric(self) -> Iterator[Array]:
        """Plays of the drive and odd functions of it."""
        u = self.drive
        yield from (u, u**3, u**5)
        count = int(np.clip(self.rest.size // SAMPLES, 4, PLAYS))
        thresholds = np.linspace(0.0, 1.0, count + 2)[1:-1] ** BENDS
        for threshold in thresholds:
            yield self.play(u, threshold)
        if self.moved:
            # The record may begin otherwise than the fit has it.
            virgin = replace(self, moved=False)
            for threshold in thresholds:
                yield virgin.play(u, threshold) - self.play(u, threshold)
            histories: tuple[History, ...] = ("virgin", "settled")
            for history in histories:
                other = self.fit.simulate(self.data.full, offset=0.0, history=history)
                yield other.x - self.x

    @cached_property
    def _columns(self) -> Array:
        """Motion of the model, and its change with each value of the model's parameters."""
        columns = [np.ones(self.x.size), self.x]
        if self.fit.delay:
            columns.append(np.gradient(self.x))
        fit, model = self.fit, self.fit.model
        kept = {one.name for one in model.info.parameters if one.held is None or one.is_list}
        changes = [
            (name, changed)
            for name in model.parameter_names()
            if name in kept and (value := getattr(model, name)) is not None
            for changed in _steps(value, zeros=True)
        ]
        if len(changes) > MOST_VALUES:
            entries = fit.details.get("parameters", {})
            changes = [
                (name, changed)
                for name in model.parameter_names()
                if entries.get(name, {}).get("free", False)
                and (value := getattr(model, name)) is not None
                for changed in _steps(value, zeros=False)
            ]
        for name, changed in changes:
            try:
                other = replace(fit, model=replace(model, **{name: changed}))
                columns.append(other.simulate(self.data.full, offset=0.0).x - self.x)
            except PiezotrackError:
                # A model that does not exist.
                continue
        return np.stack(columns, axis=1)

    def _spanning(self, matrix: Array) -> Array:
        """Return as few columns of the same span, orthonormal at the samples that count."""
        size = np.linalg.norm(self.at(matrix), axis=0)
        matrix = matrix[:, size > 0.0] / size[size > 0.0]
        _, values, right = np.linalg.svd(self.at(matrix), full_matrices=False)
        kept = values > RANK * values[0]
        spanning: Array = matrix @ (right[kept].T / values[kept])
        return spanning


def _steps(value: float | tuple[float, ...], *, zeros: bool) -> Iterator[float | tuple[float, ...]]:
    """Change a number, or each of a list in turn, by a small share of it, those of 0 too or not."""
    if not isinstance(value, tuple):
        yield value * (1.0 + STEP) if value else STEP
        return
    size = max(map(abs, value), default=0.0)
    for i, entry in enumerate(value):
        if entry or zeros:
            changed = entry * (1.0 + STEP) if entry else STEP * size
            yield (*value[:i], changed, *value[i + 1 :])


def criterion(group: Explained, samples: float) -> float:
    """Criterion of a group, low where it is good, up to a constant.

    N ln(sum of squares) + k ln N of k values and N independent samples (Schwarz 1978, doi
    10.1214/aos/1176344136).

    Parameters
    ----------
    group : Explained
        The group.
    samples : float
        Independent samples.

    Returns
    -------
    float
        The criterion.
    """
    squares = max(group.squares, 1e-300)
    return samples * float(np.log(squares)) + group.fitted * float(np.log(max(samples, 2.0)))


def independent_samples(values: Array) -> float:
    """Count the independent samples that a correlated residual is worth.

    n/(1 + 2 sum r_k) with the autocorrelations r_k up to the first within noise (Bartlett 1935,
    doi 10.2307/2342284).

    Parameters
    ----------
    values : ndarray, shape (n,)
        The residual, of mean 0.

    Returns
    -------
    float
        2 or more.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(size=4000)
    >>> round(independent_samples(np.convolve(noise, np.ones(10), "valid")), -2)
    400.0
    """
    n = values.size
    r = autocorrelation(values, n // 4)[1:]
    within = np.flatnonzero(r < 2.0 / np.sqrt(n))
    until = int(within[0]) if within.size else r.size
    return float(max(2.0, n / (1.0 + 2.0 * float(r[:until].sum()))))


def autocorrelation(values: Array, lags: int) -> Array:
    """Return the autocorrelation of values of mean 0 at the lags from 0 on, shape (lags + 1,)."""
    size = 2 * values.size
    power = np.abs(np.fft.rfft(values, size)) ** 2
    r: Array = np.fft.irfft(power, size)[: lags + 1]
    return r / r[0] if r[0] > 0.0 else np.zeros(lags + 1)
