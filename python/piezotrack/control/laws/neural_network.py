"""A small neural network as feedforward, trained on a record."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ... import _core
from ..._support.arguments import expect, in_range, not_negative
from ..._support.messages import quoted
from ...data.dataset import Dataset
from ...errors import DataError, NumericalError, ParameterError, PiezotrackError
from ...stages.inverse import Inverse
from ...stages.plays.prandtl_ishlinskii import PrandtlIshlinskiiStage

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Numbers = tuple[
        float,
        tuple[float, float, float],
        list[float],
        list[float],
        list[float],
        list[float],
        list[float],
        float,
    ]

__all__ = ["NETWORK", "NetworkInverse", "train_network"]

# Names of the numbers of a network, in their order.
NETWORK = ("centre", "scales", "thresholds", "hidden", "biases", "outputs", "direct", "constant")
MOST_UNITS, MOST_PLAYS = 16, 8
# Steps at most, and those without a better held-out error after which the training ends.
MOST_STEPS, PATIENCE = 300, 20
# Samples of a record at least.
LEAST_SAMPLES = 200
# Samples of the polynomial through which the derivatives of a record are taken, and its degree.
WINDOW, DEGREE = 9, 3
# Weight of the squared numbers of the network, in parts of the squared error.
DECAY = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkInverse(Inverse):
    """Inverse by a neural network that `train_network` has trained.

    Parameters
    ----------
    stage : Stage
        The straight line through the record: what the voltages reach, for the range of readings.
    offset, delay, playback, settle : optional
        As of `Inverse`.
    initial : None
        Not for a network, which begins as a stage that never moved.
    numbers : tuple
        Of the network, as the crate's `NetworkNumbers`.
    trained, held_out : float
        Rms errors of the voltage in the two parts of the record [V].

    Examples
    --------
    >>> import piezotrack as pt
    >>> network = pt.control.train_network(pt.datasets.dbo_training()[3.0:13.0], units=4)
    >>> loop = pt.Controller(dt=0.005, limits=(0.0, 3.6), feedforward=network)
    >>> str(network)[:41]
    '<NetworkInverse of 4 units and 6 plays: 0'
    """

    numbers: Numbers = field(default=(0.0, (1.0, 1.0, 1.0), [], [], [], [], [0.0] * 3, 0.0))
    trained: float = math.nan
    held_out: float = math.nan

    def __post_init__(self) -> None:
        if self.initial is not None:
            raise ParameterError("initial", "given", "none, a network has no stage's state")
        try:
            super().__post_init__()
        except (TypeError, ValueError, OverflowError) as error:
            if isinstance(error, PiezotrackError):
                raise
            raise ParameterError(
                "numbers", quoted(self.numbers), f"{', '.join(NETWORK)} of a network"
            ) from None

    def __repr__(self) -> str:
        _, _, thresholds, _, biases, *_ = self.numbers
        return (
            f"<NetworkInverse of {len(biases)} units and {len(thresholds)} plays: "
            f"{self.held_out:.4g} V rms in the part held out>"
        )

    def _inverse(self, dt: float) -> _core.Inverse:
        return _core.Inverse.network(self.numbers, dt, self.offset, self.delay)


def train_network(
    record: Dataset,
    *,
    units: int = 8,
    plays: int = 6,
    delay: float = 0.0,
    held_out: float = 0.3,
    seed: int = 0,
) -> NetworkInverse:
    r"""Train a small neural network as the inverse of a stage, on a record.

    .. math:: u = b + d^T i + w^T \tanh(A i + c)

    with the inputs displacement, velocity and acceleration of the record, and plays along its
    displacement, which are the memory. It is trained by Levenberg-Marquardt with the exact
    Jacobian; the last part of the record decides when to stop. The same seed gives the same
    network. It knows nothing outside of the motions of the record: where the reference goes
    elsewhere, an identified model is the better inverse.

    Parameters
    ----------
    record : Dataset
        The record; its warm-up moves the plays and is not fitted.
    units : int, optional
        Units of the hidden layer, 1 to 16.
    plays : int, optional
        Play operators, 0 to 8, with thresholds evenly over half of the stroke.
    delay : float, optional
        Delay of the displacement [s], taken off the record and given to the inverse.
    held_out : float, optional
        Share of the record, at its end, that is not trained on, 0.1 to 0.5.
    seed : int, optional
        Of the numbers that the training begins with.

    Returns
    -------
    NetworkInverse
        For ``Controller(feedforward=...)``.

    Raises
    ------
    ParameterError
        A number is out of its range, or `record` is no record.
    DataError
        The record has fewer than 200 samples, or does not move.
    NumericalError
        The training fails.

    Examples
    --------
    >>> import piezotrack as pt
    >>> network = pt.control.train_network(pt.datasets.dbo_training()[3.0:13.0], units=4)
    >>> network.held_out < 0.02 * 3.6
    True
    """
    expect("record", record, Dataset, "a pt.Dataset")
    count = _within("units", units, 1, MOST_UNITS)
    memory = _within("plays", plays, 0, MOST_PLAYS)
    share = in_range("held_out", held_out, 0.5, "parts of 1")
    if share < 0.1:
        raise ParameterError("held_out", f"{share:g}", "0.1 to 0.5")
    late = not_negative("delay", delay, "s")
    generator = np.random.default_rng(_core.as_count("seed", seed))
    full = record.full
    if record.y.size < LEAST_SAMPLES or np.ptp(record.y) == 0.0:
        raise DataError(
            f"record has {record.y.size} samples and a stroke of {np.ptp(record.y):g} m: expected "
            f"{LEAST_SAMPLES} samples or more, and a motion"
        )
    line = np.polyfit(record.u, record.y, 1)
    offset = float(line[1])
    u, motion = full.u, _motion(full.y - offset, full.dt)
    if not late < record.duration:
        raise ParameterError(
            "delay", f"{late:g} s", f"less than the record lasts, {record.duration:g} s"
        )
    if early := round(late / full.dt):
        # The reading now is the displacement of that much earlier.
        u, motion = u[:-early], motion[early:]
    first = max(0, int(np.searchsorted(full.t, record.t[0])))
    last = min(first + record.y.size, u.size)
    network = _Network.of(motion[first:last], memory, count, generator)
    inputs = network.inputs(motion[:last])[first:last]
    drive = u[first:last]
    edge = round((1.0 - share) * drive.size)
    trained, outside = network.train(inputs, drive, edge)
    return NetworkInverse(
        stage=PrandtlIshlinskiiStage(linear=float(line[0]), thresholds=(), weights=()),
        offset=offset,
        delay=late,
        numbers=network.numbers,
        trained=trained,
        held_out=outside,
    )


def _within(name: str, value: object, least: int, most: int) -> int:
    count = _core.as_count(name, value)
    if not least <= count <= most:
        raise ParameterError(name, count, f"{least} to {most}")
    return count


def _motion(y: Array, dt: float) -> Array:
    """Smooth a displacement, and take its derivatives: columns x, v and a."""
    from scipy.signal import savgol_filter

    return np.column_stack(
        [savgol_filter(y, WINDOW, DEGREE, deriv=k, delta=dt, mode="interp") for k in range(3)]
    )


@dataclass(eq=False)
class _Network:
    """A network in training: its numbers, the weights as one vector."""

    centre: float
    scales: Array
    thresholds: Array
    units: int
    weights: Array

    @classmethod
    def of(cls, motion: Array, plays: int, units: int, generator: np.random.Generator) -> _Network:
        """Scale to the motion, and begin with small random numbers."""
        low, high = float(motion[:, 0].min()), float(motion[:, 0].max())
        scales = np.array([0.5 * (high - low), *motion[:, 1:].std(axis=0)])
        # From nothing, which is the displacement itself, to where a play of the stroke is still.
        thresholds = np.arange(1, plays + 1) / (plays + 1.0)
        inputs = 3 + plays
        hidden = generator.normal(0.0, 1.0 / math.sqrt(inputs), units * inputs)
        biases = generator.uniform(-1.0, 1.0, units)
        weights = np.concatenate([hidden, biases, np.zeros(units + inputs + 1)])
        return cls(
            0.5 * (low + high), np.where(scales > 0.0, scales, 1.0), thresholds, units, weights
        )

    def inputs(self, motion: Array) -> Array:
        """Scale a motion, and follow the plays along it; shape (n, 3 + plays)."""
        scaled = (motion - [self.centre, 0.0, 0.0]) / self.scales
        # The plays begin where those of a stage that never moved are.
        columns = [_play(scaled[:, 0], r, -self.centre / self.scales[0]) for r in self.thresholds]
        return np.column_stack([scaled, *columns])

    def split(self, weights: Array) -> tuple[Array, Array, Array, Array]:
        """Return hidden rows, biases, outputs, and direct weights with the offset."""
        inputs, units = 3 + self.thresholds.size, self.units
        ends = np.cumsum([units * inputs, units, units])
        hidden, biases, outputs, direct = np.split(weights, ends)
        return hidden.reshape(units, inputs), biases, outputs, direct

    def output(self, weights: Array, inputs: Array) -> Array:
        """Return the voltages for inputs [V]."""
        hidden, biases, outputs, direct = self.split(weights)
        found: Array = np.tanh(inputs @ hidden.T + biases) @ outputs
        found += inputs @ direct[:-1] + direct[-1]
        return found

    def jacobian(self, inputs: Array) -> Array:
        """Return the derivatives of the voltages by the weights."""
        hidden, biases, outputs, _ = self.split(self.weights)
        active = np.tanh(inputs @ hidden.T + biases)
        inner = (1.0 - active**2) * outputs
        by_hidden = (inner[:, :, None] * inputs[:, None, :]).reshape(len(inputs), -1)
        return np.hstack([by_hidden, inner, active, inputs, np.ones((len(inputs), 1))])

    def train(self, inputs: Array, drive: Array, edge: int) -> tuple[float, float]:
        """Train on the samples before `edge`; return the rms errors before and after it [V].

        Levenberg-Marquardt: Nocedal and Wright, Numerical Optimization, 2nd edition, 2006,
        section 10.3. The weights with the smallest error after `edge` are kept.
        """
        inner, target = inputs[:edge], drive[:edge]
        rows = np.hstack([inner, np.ones((edge, 1))])
        # It begins with the best straight answer.
        self.weights[-rows.shape[1] :] = np.linalg.lstsq(rows, target, rcond=None)[0]
        best, least, waited = self.weights.copy(), self._rms(inputs[edge:], drive[edge:]), 0
        decay = DECAY * edge * float(np.var(target))
        cost, damping = self._cost(self.weights, inner, target, decay), 1e-2
        for _ in range(MOST_STEPS):
            residual = target - self.output(self.weights, inner)
            slopes = self.jacobian(inner)
            square = slopes.T @ slopes + decay * np.eye(self.weights.size)
            down = slopes.T @ residual - decay * self.weights
            while damping < 1e12:
                step = np.linalg.solve(square + damping * np.diag(np.diag(square)), down)
                following = self._cost(self.weights + step, inner, target, decay)
                if following < cost:
                    break
                damping *= 4.0
            else:
                break
            self.weights, cost, damping = self.weights + step, following, 0.3 * damping
            outside = self._rms(inputs[edge:], drive[edge:])
            if outside < least:
                best, least, waited = self.weights.copy(), outside, 0
            elif (waited := waited + 1) >= PATIENCE:
                break
        self.weights = best
        trained = self._rms(inner, target)
        if not math.isfinite(trained + least):
            raise NumericalError(f"the training ends at {trained} and {least} V: expected numbers")
        return trained, least

    def _cost(self, weights: Array, inputs: Array, drive: Array, decay: float) -> float:
        residual = drive - self.output(weights, inputs)
        return float(residual @ residual + decay * (weights @ weights))

    def _rms(self, inputs: Array, drive: Array) -> float:
        return float(np.sqrt(np.mean((drive - self.output(self.weights, inputs)) ** 2)))

    @property
    def numbers(self) -> Numbers:
        """Numbers that the core takes."""
        hidden, biases, outputs, direct = self.split(self.weights)
        displacement, velocity, acceleration = self.scales.tolist()
        return (
            self.centre,
            (displacement, velocity, acceleration),
            self.thresholds.tolist(),
            hidden.ravel().tolist(),
            biases.tolist(),
            outputs.tolist(),
            direct[:-1].tolist(),
            float(direct[-1]),
        )


def _play(path: Array, threshold: float, begins: float) -> Array:
    """Output of a play along a path: the core's, of a stage that has nothing else."""
    # A play alone is what is left of one with a linear part; it begins at rest at 0.
    moved = np.concatenate([[begins], path]) - begins
    stage = PrandtlIshlinskiiStage(linear=1.0, thresholds=(threshold,), weights=(1.0,))
    both: Array = stage.simulate(moved, 1.0).x[1:]
    return both - path + 2.0 * begins
