"""Notes of a fit on its record: where it begins, its lag, and where the model was not fitted."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..._support.units import drive_text, shown_unit
from ...data.checks.drive_features import has_one_amplitude

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...data.checks.drive_features import DriveFeatures
    from ...data.dataset import Dataset
    from .drift import Drift
    from .estimates import LagRange
    from .start import Start

    Array = NDArray[np.float64]

__all__ = [
    "above_noise",
    "amplitude_notes",
    "deviation_of",
    "drift_notes",
    "drive_rate",
    "extrapolation_notes",
    "first_samples",
    "fit_percent",
    "lag_notes",
    "start_notes",
]

# A residual of so many times the noise is not due to the noise.
NOISY = 3.0
# Share of the travel that a lag makes up from which a loop is due to it.
VISCOUS = 0.02
# Ratio of amplitudes of several records from which they are one.
ALIKE = 0.95
# Share of the stroke from which a drift is too large for that of a sensor.
LARGE = 0.05
# Share of the window that the first samples may be, and of the squared residual that they carry.
FIRST, CARRIED = 0.1, 0.5
# Margin of the drive's range, and factor of its rate, beyond which a model was not fitted.
MARGIN, FASTER = 0.01, 2.0
# Share of the drive's range up to which its step to the first sample is none to speak of.
JUMP = 0.01


def fit_percent(rms: float, spread: float) -> float:
    """Return the share of a motion that a model explains [%].

    Parameters
    ----------
    rms : float
        Root mean square of the residual [m].
    spread : float
        Standard deviation of the measured displacement [m].

    Returns
    -------
    float
        100 for an exact model, 0 or less for one that is no better than the mean.

    Examples
    --------
    >>> fit_percent(1e-6, 20e-6)
    95.0
    """
    return 100.0 * (1.0 - rms / spread) if spread else -math.inf


def deviation_of(records: Sequence[tuple[Dataset, float]]) -> float:
    """Return the standard deviation of measured displacements, each about its own mean [m].

    Parameters
    ----------
    records : sequence of (Dataset, float)
        The records with their weights.

    Returns
    -------
    float
        Of one record that of its displacement.
    """
    if len(records) == 1:
        data = records[0][0]
        return float(data.counted(data.y).std())
    counts = np.array([weight * len(data.counted(data.y)) for data, weight in records])
    squares = np.array([float(data.counted(data.y).var()) for data, _ in records])
    return math.sqrt(float(counts @ squares) / float(counts.sum()))


def above_noise(cost: float, noise: float) -> list[str]:
    """Say that the best model leaves more than the noise.

    Parameters
    ----------
    cost : float
        Root mean square of the residual [m].
    noise : float
        Noise of the displacement from sample to sample [m].

    Returns
    -------
    list of str
        One sentence, or none.

    Examples
    --------
    >>> above_noise(50e-9, 10e-9)
    ['the residual is 5 times the noise between samples, 10 nm: no model that was tried describes \
all of the motion']
    """
    if noise <= 0.0 or cost <= NOISY * noise:
        return []
    return [
        f"the residual is {cost / noise:.2g} times the noise between samples, "
        f"{1e9 * noise:.3g} nm: no model that was tried describes all of the motion"
    ]


def amplitude_notes(drives: Sequence[DriveFeatures]) -> list[str]:
    """Say that the drives of all records have one and the same amplitude.

    Parameters
    ----------
    drives : sequence of DriveFeatures
        The drives.

    Returns
    -------
    list of str
        One sentence, or none.
    """
    spans = [swing for drive in drives for swing in drive.swings]
    if not all(map(has_one_amplitude, drives)) or min(spans) < ALIKE * max(spans):
        return []
    swing = drive_text(max(spans), drives[0].unit)
    return [
        f"the drive has one amplitude, {swing}: the record does not determine smaller loops, which "
        "the model extrapolates"
    ]


def drift_notes(drift: Drift | None, stroke: float) -> list[str]:
    """Say that a drift is large for one.

    Parameters
    ----------
    drift : Drift or None
        Drift of a record.
    stroke : float
        Stroke of that record [m].

    Returns
    -------
    list of str
        One sentence, or none.
    """
    if drift is None or abs(drift.moved) <= LARGE * stroke:
        return []
    return [
        f"the drift of {1e6 * drift.moved:.3g} um, time constant {drift.time:.3g} s, is "
        f"{100.0 * abs(drift.moved) / stroke:.2g} % of the stroke: more than a sensor should have; "
        "it may stand for a part of the motion, such as the first cycles after rest"
    ]


def drive_rate(u: Array, dt: float) -> float:
    """Rate of a drive [V/s]: that which a thousandth of the samples exceed.

    Parameters
    ----------
    u : ndarray, shape (n,)
        Drive [V].
    dt : float
        Sampling interval [s].

    Returns
    -------
    float
        The rate; 0 for fewer than two samples.
    """
    return float(np.quantile(np.abs(np.diff(u)), 0.999)) / dt if u.size > 1 else 0.0


def extrapolation_notes(
    u: Array,
    dt: float | None,
    fitted: tuple[float, float] | None,
    rate: float | None,
    unit: str = "V",
) -> list[str]:
    """Remarks on a drive that goes beyond the record identified.

    Parameters
    ----------
    u : ndarray, shape (n,)
        Drive [V].
    dt : float or None
        Sampling interval [s]; None where the rate is not to be judged.
    fitted : (float, float) or None
        Range of the drive of the record identified [V].
    rate : float or None
        Its rate [V/s].
    unit : str, optional
        Unit of the drive, SI.

    Returns
    -------
    list of str
        A sentence for the range and one for the rate, where they are exceeded.

    Examples
    --------
    >>> extrapolation_notes(np.array([0.0, 90.0]), 1.0, (0.0, 75.0), None)
    ['the drive goes from 0 to 90 V, that of the record identified from 0 to 75 V']
    """
    notes = []
    name, scale = shown_unit(unit)
    low, high = float(u.min()), float(u.max())
    if fitted is not None:
        margin = MARGIN * (fitted[1] - fitted[0])
        if low < fitted[0] - margin or high > fitted[1] + margin:
            notes.append(
                f"the drive goes from {scale * low:.4g} to {scale * high:.4g} {name}, that of the "
                f"record identified from {scale * fitted[0]:.4g} to {scale * fitted[1]:.4g} {name}"
            )
    if rate and dt is not None and (found := drive_rate(u, dt)) > FASTER * rate:
        notes.append(
            f"the drive moves at up to {scale * found:.3g} {name}/s, that of the record identified "
            f"at {scale * rate:.3g} {name}/s: the dynamics beyond that rate were not fitted"
        )
    return notes


def start_notes(start: Start | None, data: Dataset) -> str | None:
    """Say what the stage went through before the record.

    Parameters
    ----------
    start : Start or None
        Where the record begins.
    data : Dataset
        The record.

    Returns
    -------
    str or None
        A sentence without its end.
    """
    if start is None:
        return None
    unit, first = data.drive_unit, float(data.full.u[0])
    other = start.voltage
    came_from = "" if other is None else f" of {drive_text(other, unit)}"
    if start.history == "rest":
        rest = drive_text(other or 0.0, unit)
        if abs(first - (other or 0.0)) <= JUMP * float(np.ptp(data.full.u)):
            return f"at rest at {rest}"
        return f"at rest at {rest}, then a jump of the drive to {drive_text(first, unit)}"
    before = {
        "virgin": "never moved before",
        "settled": "settled under the record's own drive",
        "fit": f"after an earlier drive{came_from}, fitted",
    }[start.history]
    return f"in equilibrium at {drive_text(first, unit)}, {before}"


def lag_notes(lags: LagRange | None, frequency: float, lag: float | None = None) -> list[str]:
    """Say which lags the record allows.

    Parameters
    ----------
    lags : LagRange or None
        Lags that fit as well.
    frequency : float
        Frequency of the drive [rad/s].
    lag : float, optional
        Lag of the model [s]; by default the least one.

    Returns
    -------
    list of str
        One sentence, or none.
    """
    if lags is None:
        return []
    lag = lags.least if lag is None else lag
    share = lag * frequency
    if lags.from_zero or share < VISCOUS:
        least = 0.0 if lags.from_zero else lags.least
        return [
            f"any lag from {1e3 * least:.2g} to {1e3 * lags.most:.2g} ms fits equally well; a "
            "record at another rate determines it"
        ]
    return [
        f"the lag of {1e3 * lag:.3g} ms contributes {100 * share:.2g} % of the travel at this "
        f"rate, and none below {1e3 * lags.least:.3g} ms fits: the model holds at this rate only. "
        "A record at another rate distinguishes damping, creep and sensor delay"
    ]


def carried_by_first_samples(rest: Array) -> bool:
    """Return whether the first tenth of a residual carries more than half of its squares."""
    squares = (rest - rest.mean()) ** 2
    count = math.floor(FIRST * rest.size)
    return count > 0 and bool(squares[:count].sum() >= CARRIED * squares.sum())


def first_samples(rest: Array, data: Dataset) -> list[str]:
    """Say that the first samples carry the cost.

    Parameters
    ----------
    rest : ndarray, shape (n,)
        Residual in the window [m].
    data : Dataset
        The record.

    Returns
    -------
    list of str
        One sentence with the seconds to leave out, or none.
    """
    squares = np.cumsum((rest - rest.mean()) ** 2)
    count = math.floor(FIRST * rest.size)
    if squares[-1] == 0.0 or not carried_by_first_samples(rest):
        return []
    # As far as the residual is well above that of the rest.
    later = (squares[-1] - squares[count - 1]) / (rest.size - count)
    above = np.flatnonzero((rest[:count] - rest.mean()) ** 2 > 4.0 * later)
    until = float(data.t[min(int(above[-1]) + 1 if above.size else count, rest.size - 1)])
    share = 100.0 * squares[count - 1] / squares[-1]
    return [
        f"{share:.0f} % of the squared residual is in the first {until - data.t[0]:.3g} s, from "
        f"the motion before the record; leave it out with log[{until:.4g}:]"
    ]
