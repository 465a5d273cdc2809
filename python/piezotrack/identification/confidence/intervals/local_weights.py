"""A fit by least squares around its result: least costs with values held, and refits.

The displacement is linear in nearly all of the values. Steps are those of Gauss and Newton with the
columns at the result; each residual is simulated.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .... import _core
from ....errors import NumericalError
from ...linearised.sensitivity import LinearisedRecord
from ...linearised.values import DELAY, Value, fitted_values, moved, sizes_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from ...fitted.identification import Identification
    from ...fitted.identified_model import IdentifiedModel

    Array = NDArray[np.float64]
    Point = tuple[float, float]
    Curve = tuple[list[Point], tuple[float | None, float | None]]

__all__ = ["LocalWeights"]

# Lists of weights none of which has another sign than the others: that of the gain, or none.
ABSOLUTE = frozenset(("weights", "masses", "concave_weights", "convex_weights"))
RELATIVE = frozenset(("stiffness_ratios", "creep_weights"))
# Values in which the displacement is linear besides, where no dead zone bends it.
LINEAR = ABSOLUTE | RELATIVE | {"linear", "piezo_coefficient"}
# Values above 0.
POSITIVE = frozenset(("time_constant", "frequency", "damping_ratio", DELAY))
# Thresholds by which a change by its size, of a value in which it is not linear, is dearer in a
# step; factor by which that grows where the cost rises and falls where it does not; and least.
DAMPING, CHANGE, FREE = 1.0, 10.0, 1e-3
# Most times that the records are linearised anew on the way to the least cost.
LINEARISED = 6
# Values of a sensor, in which its reading is linear; most that a drift is faster, as a share.
SENSOR = frozenset(("offset", "drift"))
DRIFT_TIME = -0.9
# Most steps to a least cost, and the gain, in thresholds, below which it is reached.
STEPS, LITTLE = 20, 2e-2
# Least and most factor from one distance to the next, and one beyond the end; most distances until
# a profile counts as open.
NEXT, FURTHER, MOST = (1.1, 3.0), 2.0, 24
# First distance by which the end is foretold, as a share of the value; factors by which it
# changes, and most changes.
FIRST, FACTORS, FORETOLD = 0.1, (0.05, 20.0), 8
# Share of the threshold within which an end is found, share of a bracket at whose ends nothing is
# tried, and most descents that refine it.
NEAR, EDGE, REFINED = 0.02, 0.2, 12
# Least gain of a minimum beside the fit, in thresholds, and times that one is followed.
LOWER, FOLLOWED = 0.05, 4


class _Point(NamedTuple):
    """Changes of all values from the fit, in shares of their sizes, with the weighted residual."""

    place: Array
    residual: Array
    cost: float


class _Step(NamedTuple):
    """Distance of a point of a profile from the least cost, and the root of its rise."""

    distance: float
    root: float
    point: _Point


class LocalWeights:
    """A fit by least squares around its result, as `_core.LocalFit` is of a search.

    Parameters
    ----------
    fit : Identification
        The result.

    Attributes
    ----------
    coordinates : list of (int, str, float, float)
        Record, name, lowest and highest number of each value, SI.
    tied : list of str
        None.
    """

    def __init__(self, fit: Identification) -> None:
        self.fit = fit
        data = [one.data for one in fit.records if one.data is not None]
        self.records = [LinearisedRecord(fit, one) for one in data]
        self.weights = [one.weight for one in fit.records]
        order = fit.model.parameter_names()
        self.values = sorted(
            {*fitted_values(fit), *_at_zero(fit)},
            key=lambda one: ([*order, DELAY].index(one.parameter), one.entry or 0),
        )
        self.fitted = np.array([one.of(fit) for one in self.values])
        self.sizes = sizes_of(fit, self.values, data[0].dt)
        self.low, self.high = self._bounds()
        linear = LINEAR if not getattr(fit.model, "dead_zone_weights", ()) else frozenset[str]()
        self.bent = np.array([value.parameter not in linear for value in self.values])
        self.coordinates = [
            (0, str(value), float(low), float(high))
            for value, low, high in zip(
                self.values,
                self.fitted + self.low * self.sizes,
                self.fitted + self.high * self.sizes,
                strict=True,
            )
        ]
        self.tied: list[str] = []
        self.own = [one.nuisance() for one in self.records]
        self.alone = [(r, name) for r, columns in enumerate(self.own) for name in columns]
        self.sizes_alone = np.array([self._size_alone(r, name) for r, name in self.alone])
        self.orthogonal, self.triangle = self._linearised(fit)
        bent = np.array([name not in SENSOR for _, name in self.alone], dtype=bool)
        self.bent = np.concatenate([self.bent, bent])
        shortest = [DRIFT_TIME if name == "drift_time" else -np.inf for _, name in self.alone]
        self.low = np.append(self.low, shortest)
        self.high = np.append(self.high, np.full(len(self.alone), np.inf))
        counts = [one.residual.size for one in self.records]
        self.samples = sum(counts)
        self.counted = sum(w * n for w, n in zip(self.weights, counts, strict=True))

    def _bounds(self) -> tuple[Array, Array]:
        """Bounds of the changes, in shares of the sizes."""
        low, high = np.full(len(self.values), -np.inf), np.full(len(self.values), np.inf)
        falls = sum(one.of(self.fit) for one in self.values if one.parameter in ABSOLUTE) < 0.0
        for k, value in enumerate(self.values):
            shares = self.fitted[k] / self.sizes[k]
            if value.parameter in ABSOLUTE and falls:
                high[k] = -shares
            elif value.parameter in ABSOLUTE | RELATIVE | POSITIVE:
                low[k] = -shares
        return low, high

    def _size_alone(self, record: int, name: str) -> float:
        """Size of a value of a record alone, SI."""
        one, drift = self.records[record], self.fit.records[record].drift
        if name == "drift_time" and drift is not None:
            return drift.time
        return {"voltage_before": float(np.ptp(one.data.full.u)), DELAY: one.data.dt}.get(name, 1.0)

    def _linearised(self, model: IdentifiedModel) -> tuple[Array, Array]:
        """Factors of the change of all weighted readings with each value about a model."""
        blocks = []
        for r, (record, weight) in enumerate(zip(self.records, self.weights, strict=True)):
            shared = record.columns(model, self.values) * self.sizes[:, None]
            none = np.zeros(record.residual.size)
            each = zip(self.alone, self.sizes_alone, strict=True)
            mine = [size * self.own[r][name] if q == r else none for (q, name), size in each]
            blocks.append(math.sqrt(weight) * np.array([*shared, *mine]).T)
        orthogonal, triangle = np.linalg.qr(np.concatenate(blocks))
        return orthogonal, triangle

    def cost(self, values: Sequence[float]) -> float:
        """Return the cost at values, those of the records alone as in the fit [m]."""
        point = self._at(self._place(values))
        return math.inf if point is None else point.cost

    def profiles(
        self, values: Sequence[float], wanted: Sequence[tuple[int, float]]
    ) -> tuple[tuple[list[float], float], list[Curve]]:
        """Return the least cost near values, and profiles from there.

        Parameters
        ----------
        values : sequence of float
            In the order of `coordinates`, SI.
        wanted : sequence of (int, float)
            Places of coordinates, and the relative rise of the squared cost at the ends.

        Returns
        -------
        minimum : (list of float, float)
            Its values and its cost [m].
        curves : list of (list of (float, float), (float or None, float or None))
            Values and costs, ascending, and both ends; None for one that is open.
        """
        rise = min((rise for _, rise in wanted), default=1.0 / self.samples)
        least = self._settled(values, rise)
        for followed in range(FOLLOWED + 1):
            sides = [[self._side(k, way, rise, least) for way in (-1.0, 1.0)] for k, rise in wanted]
            steps = [step for pair in sides for side, _ in pair for step in side]
            lowest = min((step.point for step in steps), key=lambda one: one.cost, default=least)
            lower = (least.cost / lowest.cost) ** 2 - 1.0 > LOWER * rise
            if not lower or followed == FOLLOWED:
                break
            least = self._settled(self._numbers(lowest), rise)
        curves = [self._curve(k, pair, least) for (k, _), pair in zip(wanted, sides, strict=True)]
        return (self._numbers(least), least.cost), curves

    def refits(
        self, values: Sequence[float], noises: Sequence[Array], draws: int, seed: int
    ) -> list[tuple[list[float], float]]:
        """Return fits to what values predict with resampled noise.

        Parameters
        ----------
        values : sequence of float
            In the order of `coordinates`, SI.
        noises : sequence of ndarray
            Noise of each record [m].
        draws : int
            How many.
        seed : int
            Seed of the noises.

        Returns
        -------
        list of (list of float, float)
            Values and cost of each.
        """
        least = self._settled(values, 1.0 / self.samples)
        active = np.count_nonzero((least.place > self.low) & (least.place < self.high))
        scale = self.samples / max(self.samples - int(active), 1)
        drawn = [
            _core.resampled_noises(noise, scale, draws, seed + r) for r, noise in enumerate(noises)
        ]
        found = []
        for several in zip(*drawn, strict=True):
            each = zip(self.weights, several, strict=True)
            noise = np.concatenate([math.sqrt(w) * np.array(one) for w, one in each])
            refit = self._least(least, {}, 1.0 / self.samples, noise - least.residual)
            found.append((self._numbers(refit), refit.cost))
        return found

    def _place(self, values: Sequence[float]) -> Array:
        place = np.zeros(self.low.size)
        place[: self.fitted.size] = (np.array(values) - self.fitted) / self.sizes
        return place

    def _numbers(self, point: _Point) -> list[float]:
        """Values of a point, those of the records alone left out, SI."""
        changed = self.sizes * point.place[: self.fitted.size]
        return [float(number) for number in self.fitted + changed]

    def _at(self, place: Array, added: Array | float = 0.0) -> _Point | None:
        """Simulate a place; None where there is no such stage."""
        count = self.fitted.size
        model = moved(self.fit, self.values, self.sizes * place[:count])
        if model is None:
            return None
        own: list[dict[str, float]] = [{} for _ in self.records]
        for (r, name), change in zip(self.alone, self.sizes_alone * place[count:], strict=True):
            own[r][name] = float(change)
        each = zip(self.records, self.weights, own, strict=True)
        left = [math.sqrt(w) * record.residual_of(model, alone) for record, w, alone in each]
        residual = np.concatenate(left) + added
        return _Point(place, residual, math.sqrt(float(residual @ residual) / self.counted))

    def _right(self, point: _Point) -> Array:
        """Right side of the linear problem about a point."""
        return np.asarray(self.orthogonal.T @ point.residual + self.triangle @ point.place)

    def _solved(
        self, right: Array, at: Array, held: Mapping[int, float], damping: float = 0.0
    ) -> Array:
        """Solve the linear problem with some changes held, not far from a place."""
        damped = math.sqrt(damping) * np.eye(at.size)[self.bent]
        rows = np.concatenate([self.triangle, damped])
        right = np.concatenate([right, damped @ at])
        place, fixed = at.copy(), np.zeros(at.size, dtype=bool)
        for k, share in held.items():
            place[k], fixed[k] = share, True
        right = right - rows[:, fixed] @ place[fixed]
        bounds = zip(self.low[~fixed].tolist(), self.high[~fixed].tolist(), strict=True)
        place[~fixed] = _core.bounded_least_squares(
            rows[:, ~fixed].tolist(), right.tolist(), list(bounds)
        )
        return place

    def _settled(self, values: Sequence[float], rise: float) -> _Point:
        """Point of the least cost near values."""
        point = self._at(self._place(values))
        if point is None:
            raise NumericalError("the fitted model cannot be simulated")
        for _ in range(LINEARISED):
            before, point = point.cost, self._least(point, {}, rise)
            model = moved(self.fit, self.values, self.sizes * point.place[: self.fitted.size])
            if model is None or (before / point.cost) ** 2 - 1.0 <= LOWER * rise:
                break
            self.orthogonal, self.triangle = self._linearised(model)
        return point

    def _least(
        self, start: _Point, held: Mapping[int, float], rise: float, added: Array | float = 0.0
    ) -> _Point:
        """Least cost with some changes held, from the linear problem about a point on."""
        at = start._replace(residual=start.residual + added)
        square = float(at.residual @ at.residual)
        damping = DAMPING * rise * square
        settled = False
        best = at._replace(cost=math.inf if held else math.sqrt(square / self.counted))
        for _ in range(STEPS):
            right = self._right(at)
            place = self._solved(right, at.place, held, damping)
            there, here = (self.triangle @ one - right for one in (place, at.place))
            if math.isfinite(best.cost) and here @ here - there @ there <= LITTLE * rise * square:
                if settled or damping <= FREE * rise * square:
                    break
                damping /= CHANGE
                continue
            after = self._at(place, added)
            if after is None or after.cost >= best.cost:
                damping *= CHANGE
                settled = True
            else:
                best = at = after
                damping /= CHANGE
        return best

    def _side(
        self, k: int, way: float, rise: float, least: _Point
    ) -> tuple[list[_Step], float | None]:
        """Points of a profile on one side of the least cost, and its end."""
        reach = way * ((self.high if way > 0.0 else self.low)[k] - least.place[k])
        if reach <= 0.0:
            return [], None
        steps = [_Step(0.0, 0.0, least)]

        def descend(distance: float) -> bool:
            point = self._least(least, {k: least.place[k] + way * distance}, rise)
            if not math.isfinite(point.cost):
                return False
            above = (point.cost / least.cost) ** 2 - 1.0
            steps.append(_Step(distance, math.sqrt(max(above, 0.0) / rise), point))
            steps.sort(key=lambda step: step.distance)
            return True

        distance = 0.5 * self._foretold(k, way, rise, least, reach)
        for _ in range(MOST):
            if not descend(distance) or steps[-1].root > 1.0 or distance >= reach:
                break
            further = (1.0 + NEAR) / max(steps[-1].root, NEAR) * distance
            distance = min(max(further, NEXT[0] * distance), NEXT[1] * distance, reach)
        for _ in range(REFINED):
            after = next((i for i, step in enumerate(steps) if step.root >= 1.0), None)
            if after is None:
                return steps[1:], None
            inside, outside = steps[after - 1], steps[after]
            width = outside.distance - inside.distance
            share = (1.0 - inside.root) / (outside.root - inside.root)
            end = inside.distance + share * width
            near = min(1.0 - inside.root, outside.root - 1.0) < NEAR
            if near or not descend(inside.distance + min(max(share, EDGE), 1.0 - EDGE) * width):
                break
        if steps[-1].root < 2.0 and steps[-1].distance < reach:
            descend(min(FURTHER * steps[-1].distance, reach))
        place = least.place[k] + way * end
        return steps[1:], float(self.fitted[k] + self.sizes[k] * place)

    def _foretold(self, k: int, way: float, rise: float, least: _Point, reach: float) -> float:
        """Distance of an end by the linear problem; the bound where it is further."""
        right = self._right(least)
        here = self.triangle @ least.place - right
        distance, square = min(FIRST, reach), float(least.residual @ least.residual)
        for _ in range(FORETOLD):
            held = {k: least.place[k] + way * distance}
            there = self.triangle @ self._solved(right, least.place, held) - right
            root = math.sqrt(max(float(there @ there - here @ here) / (square * rise), 0.0))
            if abs(root - 1.0) < FIRST or (root < 1.0 and distance >= reach):
                break
            factor = min(max(1.0 / max(root, NEAR), FACTORS[0]), FACTORS[1])
            distance = min(factor * distance, reach)
        return distance

    def _curve(self, k: int, sides: list[tuple[list[_Step], float | None]], least: _Point) -> Curve:
        """Points of both sides in ascending order, with the ends."""
        (below, low), (above, high) = sides
        points = [*(one.point for one in reversed(below)), least, *(one.point for one in above)]
        numbers = self.fitted[k] + self.sizes[k] * np.array([one.place[k] for one in points])
        costs = [one.cost for one in points]
        return list(zip(numbers.tolist(), costs, strict=True)), (low, high)


def _at_zero(fit: Identification) -> list[Value]:
    """List the weights that are 0, of lists that were fitted."""
    entries = fit.details.get("parameters", {})
    return [
        Value(name, k)
        for name in fit.model.parameter_names()
        if name in ABSOLUTE | RELATIVE and entries.get(name, {}).get("free", False)
        for k, number in enumerate(getattr(fit.model, name))
        if number == 0.0
    ]
