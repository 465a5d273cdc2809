"""Changes of a stage that are fitted to the residual of a model, and the verdicts on them."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import stdtrit

from ... import _core
from ..._support.statistics import sample_noise
from ..fitted.start import begin, same_beginning, start_after, start_at_jump
from ..linearised.sensitivity import sensitivity
from ..linearised.values import fitted_values
from .correlated import Autoregression
from .health import RATIOS, Change
from .known import Known
from .motion import Motion

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ...stages.motion import StageState
    from ..fitted.identified_model import IdentifiedModel
    from ..fitted.start import Start
    from .health import Verdict

    Array = NDArray[np.float64]

__all__ = ["Judgement"]

NAMES = ("gain", "hysteresis", "mode", "lag", "delay", "drift")
UNITS = {"delay": "s", "drift": "m"}
# Probability that an interval of a result does not hold.
WRONG = 0.05
# Half width of an interval beyond which a change is not judged: relative; of the delay in parts of
# the rms of the motion that it makes, of the drift in parts of the stroke.
WIDEST = {"gain": 0.1, "hysteresis": 0.5, "mode": 0.2, "lag": 1.0, "delay": 0.05, "drift": 0.05}
# Least change that a record shows from which on "unchanged" alone would mislead: relative; a ratio.
COARSE, COARSE_RATIO = 0.1, 2.0
# Part of the range identified that the drive covers at least.
COVERED = 0.2
# Model error on another record, in those of the record identified: 3.2 seen on a measured stage.
OTHER_RECORD = 4.0
# Spread of the noise from third differences of n samples: this over sqrt(n). The least ratio that
# counts as another noise, and how alike two sampling intervals are.
NOISE_SPREAD, OTHER_NOISE, ALIKE = 1.5, 1.1, 0.01
# Rounds of a fit, and the largest change that it makes.
ROUNDS, LARGEST = 4, 0.8
# A residual of so many times that of the fit is not explained by a simple history.
EXPLAINED = 2.0
# Correlation of two columns that cannot be distinguished.
SAME = 0.9


class Judgement:
    """Changes that explain the residual of a model on a record.

    Parameters
    ----------
    model : IdentifiedModel
        The model.
    data : Dataset
        The record.
    known : Known
        Residual of the model on its own record.
    """

    def __init__(self, model: IdentifiedModel, data: Dataset, known: Known) -> None:
        self.model, self.data, self.known = model, data, known
        still = _still(model, data)
        self.motion = Motion(model, data, _start(model, data, still))
        self.still = data.counted(still)
        self.y = data.counted(data.y)
        first = self._left(self._at({}), self.still if model.drift else self.still[:, :1])
        # As far as an offset and a drift of a sensor that drifts do not explain it.
        self.before = Autoregression(first, self.still.shape[1])
        self.rms = float(np.sqrt(np.mean(first**2)))
        low, high = known.drive_range
        self.covered = float(np.ptp(data.full.u)) / (high - low) if high > low else 1.0

    def _at(self, changes: dict[str, float]) -> Array:
        return self.data.counted(self.motion.displacement(changes))

    def _left(self, x: Array, columns: Array) -> Array:
        rest = self.y - x
        left: Array = rest - columns @ np.linalg.lstsq(columns, rest, rcond=None)[0]
        return left

    def _columns(self, names: Sequence[str], at: dict[str, float]) -> tuple[Array, Array, Array]:
        """Displacement, its derivatives, and of these what the fit has for each name.

        Of hysteresis, mode and lag it has what is not a change of the gain, of mode and lag neither
        of the delay: the last matrix gives the changes of the model from those fitted.
        """
        x, raw = self.motion.derivatives([name for name in names if name != "drift"], at)
        x, columns, back = self.data.counted(x), self.data.counted(raw), np.eye(len(names))
        if "drift" in names:
            columns = np.insert(columns, names.index("drift"), self.still[:, 1], axis=1)
        for i, name in enumerate(names):
            taken = {"hysteresis": ("gain",), "mode": ("gain", "delay"), "lag": ("gain", "delay")}
            others = [names.index(one) for one in taken.get(name, ()) if one in names]
            if others:
                basis = np.concatenate([self.still, columns[:, others]], axis=1)
                share = _solved(basis, columns[:, i])
                columns[:, i] -= basis @ share
                back[others, i] = -share[2:]
        return x, columns, back

    def _fit(self, names: Sequence[str]) -> tuple[dict[str, float], dict[str, float], Array]:
        """Values and half widths of the intervals of some changes, and what they leave."""
        at: dict[str, float] = {}
        values = np.zeros(len(names))
        rms = math.inf
        for _ in range(ROUNDS):
            x, columns, back = self._columns(names, at)
            whole = np.concatenate([self.still[:, :1], columns], axis=1)
            rest = self._left(x, self.still[:, :1])
            left = rest - whole @ (found := _solved(whole, rest))
            # Drift is linear: it is what this round finds. The rest is added to what there is.
            step = back @ found[1:]
            kept = {name: at.get(name, 0.0) + float(step[i]) for i, name in enumerate(names)}
            if "drift" in kept:
                kept["drift"] = float(step[list(names).index("drift")])
            values = np.linalg.solve(back, np.array([kept[name] for name in names]))
            if not (size := float(np.sqrt(np.mean(left**2)))) < 0.999 * rms:
                break
            rms = size
            at = {name: float(np.clip(v, *self._ends(name))) for name, v in kept.items()}
        widths = self._widths(names, columns, whole, left)
        return dict(zip(names, values.tolist(), strict=True)), widths, left

    def _ends(self, name: str) -> tuple[float, float]:
        if name in UNITS:
            most = math.inf if name == "drift" else 0.1 * self.data.duration
            return -most, most
        return -LARGEST, 1.0 / (1.0 - LARGEST) - 1.0

    def _widths(
        self, names: Sequence[str], columns: Array, whole: Array, left: Array
    ) -> dict[str, float]:
        """Half widths of the intervals, for noise, for the model's own record and its error."""
        process = Autoregression(left, whole.shape[1])
        spread = _deviations(columns, left)
        spread = np.hypot(spread, self._of_model(whole, spread))
        quantile = self.quantile(process.effective - whole.shape[1])
        widths = {}
        for i, name in enumerate(names):
            others = np.delete(whole, i + 1, axis=1)
            alone = columns[:, i] - others @ _solved(others, columns[:, i])
            size = float(np.sqrt(np.mean(alone**2)))
            error = self.known.model_error / size if size > 0.0 else math.inf
            widths[name] = quantile * float(spread[i]) + error
        if "drift" in widths and self.model.drift:
            # A sensor that drifted along its own record may do so again.
            widths["drift"] += abs(self.model.drift.moved)
        return widths

    def _of_model(self, whole: Array, spread: Array) -> Array:
        """Return the standard deviations of the changes for the covariance of the model.

        Of a model without a covariance they are as of one identified from this record.
        """
        covariance = self.model.covariance
        if covariance is None:
            return spread
        scale = np.linalg.norm(whole, axis=0)
        scale[scale == 0.0] = 1.0
        changes = self._effects @ (np.linalg.pinv(whole / scale, rcond=1e-12).T / scale)[:, 1:]
        return covariance.spread(changes)

    @cached_property
    def _effects(self) -> Array:
        """Change of the displacement with each value of the model, shape (p, n) [m/...]."""
        return sensitivity(self.model, self.data, fitted_values(self.model)).columns

    def quantile(self, freedom: float) -> float:
        """Half width of an interval in standard deviations, for all of the result at once."""
        wrong = WRONG / (len(NAMES) + 2)
        return float(stdtrit(max(freedom, 2.0), 1.0 - 0.5 * wrong))

    def changes(self) -> tuple[Change, ...]:
        """Judge residual, changes and noise.

        Returns
        -------
        tuple of Change
            In this order.
        """
        names = [name for name in NAMES if self.motion.knows(name)]
        reasons = {
            name: f"the model has no {name}" if name != "hysteresis" else
            "the model has no factor of its hysteresis" for name in NAMES if name not in names
        }  # fmt: skip
        if self.covered < COVERED:
            for name in [one for one in ("gain", "hysteresis") if one in names]:
                names.remove(name)
                reasons[name] = (
                    f"the drive covers {100.0 * self.covered:.2g} % of the range identified: "
                    f"expected {100.0 * COVERED:.0f} % or more"
                )
        widest = self._widest()
        while True:
            values, widths, left = self._fit(names)
            worst = max(names, key=lambda name: widths[name] / widest[name])
            if widths[worst] <= widest[worst] or len(names) == 1:
                break
            names.remove(worst)
            reasons[worst] = self._reason(worst, widths[worst], names)
        judged = {name: self._judged(name, values[name], widths[name]) for name in names}
        dropped = {name: Change(name, None, None, UNITS.get(name, ""), "not judged", why)
                   for name, why in reasons.items()}  # fmt: skip
        found = judged | dropped
        return (
            self._residual(),
            *(self._with_alike(found[name], reasons) for name in NAMES),
            self._noise(left),
        )

    def _widest(self) -> dict[str, float]:
        x = self._at({})
        rate = np.gradient(x) / self.data.dt
        speed = float(np.sqrt(np.mean(rate**2)))
        shift = float(np.std(x)) / speed if speed > 0.0 else 0.0
        scales = {"delay": shift, "drift": self.model.stroke}
        return {name: limit * scales.get(name, 1.0) or 1e-300 for name, limit in WIDEST.items()}

    def _reason(self, name: str, width: float, kept: Sequence[str]) -> str:
        """Why a change is not judged."""
        _, columns, _ = self._columns([name], {})
        alone = self._widths([name], columns, np.concatenate([self.still, columns], axis=1),
                             self._left(self._at({}), self.still))[name]  # fmt: skip
        other = self._likest(name, kept)
        if alone <= self._widest()[name] and other is not None:
            return f"in this record it cannot be distinguished from a change of the {other}"
        if not math.isfinite(width) or width > 1e3 * self._widest()[name]:
            return "the record does not show it"
        scale, unit = {"delay": (1e3, "ms"), "drift": (1e6, "um")}.get(name, (100.0, "%"))
        return (
            f"its interval is +-{scale * width:.3g} {unit}: expected "
            f"{scale * self._widest()[name]:.3g} {unit} or less"
        )

    def _likest(self, name: str, kept: Sequence[str]) -> str | None:
        """Which of the other changes moves the displacement most alike."""
        alike = {}
        for other in kept:
            columns = self._raw([name, other])
            a, b = (column / np.linalg.norm(column) for column in columns.T)
            alike[other] = abs(float(a @ b))
        best = max(alike, key=lambda one: alike[one], default=None)
        return best if best is not None and alike[best] > 0.5 else None

    def _raw(self, names: Sequence[str]) -> Array:
        """Return the derivatives without offset, before one is taken off another."""
        _, columns, back = self._columns(names, {})
        raw: Array = columns @ np.linalg.inv(back)
        raw -= raw.mean(axis=0)
        return raw

    def _judged(self, name: str, value: float, width: float) -> Change:
        interval = value - width, value + width
        verdict: Verdict = "unchanged" if interval[0] <= 0.0 <= interval[1] else "changed"
        return _with_limit(Change(name, value, interval, UNITS.get(name, ""), verdict))

    def _with_alike(self, change: Change, reasons: dict[str, str]) -> Change:
        """Name the changes that would look the same as one that is judged."""
        told = f"cannot be distinguished from a change of the {change.name}"
        others = [name for name, why in reasons.items() if why.endswith(told)]
        if change.verdict != "changed" or not others:
            return change
        return change._replace(reason=f"or the {' or the '.join(others)}: they look alike here")

    def _residual(self) -> Change:
        known, ratio = self.known, self.rms / self.known.rms
        longer = 1.0 if known.duration is None else self.data.duration / known.duration
        effective = self.before.effective
        width = self.quantile(effective) * math.sqrt((1.0 + longer) / (2.0 * effective))
        noise = math.sqrt(max(known.rms**2 - known.model_error**2, 0.0))
        larger = math.hypot(noise, OTHER_RECORD * known.model_error) / known.rms
        interval = ratio * math.exp(-width) / larger, ratio * math.exp(width)
        verdict: Verdict = "changed" if interval[0] > 1.0 else "unchanged"
        return _with_limit(Change("residual", ratio, interval, "", verdict))

    def _noise(self, left: Array) -> Change:
        known = self.known
        noise = min(sample_noise(self.y), sample_noise(left))
        reason = ""
        if known.noise is None:
            reason = "the model has no noise of its record"
        elif abs(self.data.dt / known.dt - 1.0) > ALIKE:
            reason = (
                f"the record has a sample every {1e3 * self.data.dt:.4g} ms, that of the model "
                f"every {1e3 * known.dt:.4g} ms"
            )
        if reason or known.noise is None:
            return Change("noise", None, None, "", "not judged", reason)
        ratio = noise / known.noise
        own = self.y.size if known.duration is None else known.duration / known.dt
        spread = NOISE_SPREAD * math.sqrt(1.0 / self.y.size + 1.0 / own)
        width = self.quantile(math.inf) * spread + math.log(OTHER_NOISE)
        interval = ratio * math.exp(-width), ratio * math.exp(width)
        verdict: Verdict = "unchanged" if interval[0] <= 1.0 <= interval[1] else "changed"
        return _with_limit(Change("noise", ratio, interval, "", verdict))


def _with_limit(change: Change) -> Change:
    """Say of a change that is not seen how large it may be, where that is much."""
    least = change.detectable
    if change.verdict != "unchanged" or change.unit or least is None:
        return change
    is_ratio = change.name in RATIOS
    if least <= (COARSE_RATIO if is_ratio else COARSE):
        return change
    shown = f"x{least:.2g}" if is_ratio else f"{100.0 * least:.2g} %"
    return change._replace(reason=f"less than {shown} could not be seen in this record")


def _deviations(columns: Array, left: Array) -> Array:
    """Return standard deviations beside an offset; infinite where nothing shows a coefficient."""
    count = columns.shape[1]
    record = (list(columns.T), [np.ones(left.size)], left, left, 1.0)
    found = _core.linearised_covariance([record], np.zeros((count, count)).tolist(), 0, 0)
    deviations = np.sqrt(np.maximum(np.diag(np.array(found[0])), 0.0))
    return np.where(found[1], deviations, np.inf)


def _still(model: IdentifiedModel, data: Dataset) -> Array:
    """Columns that have nothing to do with the drive: offset, and drift by 1 m [n, 2]."""
    t, drift = data.t - data.t[0], model.drift
    shape = t / t[-1]
    if drift and drift.time < 10.0 * float(t[-1]):
        shape = np.expm1(-t / drift.time) / np.expm1(-t[-1] / drift.time)
    return np.stack([np.ones(t.size), shape], axis=1)


def _start(model: IdentifiedModel, data: Dataset, still: Array) -> Start:
    """Where a record begins, as it shows it whatever else has changed."""
    known = model.start
    if same_beginning(known, data) or len(model.records) > 1:
        return model.start_on(data)
    stage = model.model
    virgin = Motion(model, data, start_after(stage, data, "virgin"))
    names = [name for name in NAMES if name != "drift" and virgin.knows(name)]
    basis = np.concatenate([still, virgin.derivatives(names, {})[1]], axis=1)

    scale = np.linalg.norm(basis, axis=0)
    basis /= np.where(scale > 0.0, scale, 1.0)
    inverses: dict[int, Array] = {}

    def residual(part: Dataset, state: StageState) -> Array:
        columns, rest = basis[: len(part)], part.y - virgin.read(stage, state, part)
        if len(part) not in inverses:
            inverse = np.linalg.pinv(part.counted(columns), rcond=1e-9)
            inverses[len(part)] = inverse.astype(np.float64)
        left: Array = rest - columns @ (inverses[len(part)] @ part.counted(rest))
        return left

    enough = EXPLAINED * Known.of(model).rms
    start = begin(
        stage, data, None, residual, offset=True, enough=enough, reached=model.drive_range
    )
    if known is None or known.rest is None:
        return start
    jump = start_at_jump(stage, data, known.rest)
    both = [float(np.std(data.counted(residual(data, one.state)))) for one in (start, jump)]
    return jump if both[1] < both[0] else start


def _solved(columns: Array, rest: Array) -> Array:
    """Coefficients of least squares, for columns of any scale; 0 for one that is 0."""
    scale = np.linalg.norm(columns, axis=0)
    scale[scale == 0.0] = 1.0
    found: Array = np.linalg.lstsq(columns / scale, rest, rcond=1e-12)[0] / scale
    return found
