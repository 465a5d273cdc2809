"""The residual of a fit: its whiteness, where it is large, and the ingredient that it lacks."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np

from ...._support.arguments import expect
from ...._support.display.result import Result
from ...._support.statistics import sample_noise
from ....data.checks.diagnostics import amplitudes
from ....errors import ParameterError
from ...fitted.identification import Identification
from .ingredients import explanations
from .situation import Situation, autocorrelation, criterion, independent_samples

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ....data.dataset import Dataset
    from .situation import Explained

    Array = NDArray[np.float64]
    Mask = NDArray[np.bool_]

__all__ = ["Ingredient", "Residual", "ResidualProfile", "residual_of"]

# Lags of the portmanteau, and the probability with which white noise stays below the threshold.
LAGS, CONFIDENCE = 20, 0.99
# Bins of a profile, and samples from which a bin counts.
BINS, FEWEST = 16, 4
# Samples in which an ingredient is looked for, and those needed.
MOST, LEAST = 20_000, 100
# Least decrease of the criterion by the ingredient, and its lead over the next one.
CLEAR, AHEAD = 20.0, 10.0
# Least share of the systematic residual that it explains beside a loop of another shape; or both
# alone, and of what such a loop leaves. Least share of the whole residual.
SHARE, ALONE, WORTH = 0.2, 0.5, 0.15
# Difference of what two explain, as a share, that a model which is not exact may make.
ALIKE = 0.02
# Share of its square by which the noise is not known.
UNSURE = 0.05


class ResidualProfile(NamedTuple):
    """How a residual depends on a quantity, in bins of equal width.

    Attributes
    ----------
    quantity : {"time", "drive", "rate", "amplitude"}
        The quantity. The amplitude is half of the drive's travel between the turning points around
        a sample.
    unit : str
        Its unit, SI.
    centres : ndarray, shape (k,)
        Middle of each bin that has samples.
    means, rms : ndarray, shape (k,)
        Mean and root mean square of the residual in each [m].
    """

    quantity: str
    unit: str
    centres: Array
    means: Array
    rms: Array


@dataclass(frozen=True, kw_only=True)
class Ingredient:
    """An ingredient that a model may lack.

    Attributes
    ----------
    name : {"creep", "mode", "delay", "asymmetry", "rate", "hum", "drift"}
        ``"mode"`` is a resonance, ``"delay"`` a delay or a first-order lag, ``"asymmetry"`` one of
        the hysteresis, and ``"rate"`` hysteresis that depends on the rate.
    share : float
        Share of the squared residual that it explains, the parameters and the shape of a symmetric
        loop adjusted along with it.
    gain : float
        Part of that share which the adjusted loop does not explain without it.
    alone : float
        Share that it explains with the parameters of the model only.
    count : int
        Values that were fitted for it.
    detail : str
        Time constants or frequencies, in words.
    """

    name: str
    share: float
    gain: float
    alone: float
    count: int
    detail: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Residual(Result):
    r"""The residual of a fit on one of its records, measured less simulated.

    Whiteness is judged by the portmanteau of Ljung and Box 1978 (Biometrika 65(2), 297-303, doi
    10.1093/biomet/65.2.297),

    .. math:: Q = n (n + 2) \sum_{k=1}^{m} \frac{r_k^2}{n - k}

    with the autocorrelations r_k, against the 99 % quantile of a chi-squared distribution of m
    degrees of freedom.

    Attributes
    ----------
    data : Dataset
        The record.
    values : ndarray, shape (n,)
        The residual in the window [m].
    kept : ndarray of bool, shape (n,)
        Samples that count.
    rate : ndarray, shape (n,)
        Rate of the drive [V/s].
    amplitude : ndarray, shape (n,)
        Half of the travel of the drive between the turning points around a sample [V].
    stroke : float
        Stroke of the record [m].
    portmanteau, threshold : float
        Q and the value that white noise exceeds once in a hundred records.
    noise : float
        White part, from sample to sample [m].
    profiles : tuple of ResidualProfile
        By time, drive, rate and amplitude.
    candidates : tuple of Ingredient
        Ingredients that may be missing, the most likely first; none where the residual is white or
        has fewer than 100 samples.
    shape : float
        Share of the squared residual that a symmetric loop of another shape explains.
    likely : int
        How many of the candidates cannot be distinguished; 0 where none explains the residual.
    correlations : ndarray, shape (m,)
        Autocorrelations of the residual, from a lag of one sample on.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "identification.views.confidence.residual_report:residual_text",
        "plot": "identification.views.confidence.residual_plot:plot_residual",
    }

    data: Dataset
    values: Array
    kept: Mask
    rate: Array
    amplitude: Array
    stroke: float
    portmanteau: float
    threshold: float
    noise: float
    profiles: tuple[ResidualProfile, ...]
    candidates: tuple[Ingredient, ...] = ()
    shape: float = 0.0
    likely: int = 0
    correlations: Array = field(repr=False)

    def __repr__(self) -> str:
        return f"<Residual, {1e9 * self.rms:.3g} nm rms, cause {self.cause}>"

    @property
    def rms(self) -> float:
        """Root mean square [m]."""
        return float(np.sqrt(np.mean(self.values[self.kept] ** 2)))

    @property
    def is_white(self) -> bool:
        """Whether it cannot be distinguished from white noise."""
        return self.portmanteau <= self.threshold

    @property
    def cause(self) -> str | None:
        """The missing ingredient; None where none explains it, or several do."""
        return self.candidates[0].name if self.likely == 1 else None


def residual_of(fit: Identification, record: int = 0) -> Residual:
    """Judge the residual of a fit: its whiteness, where it is large, and what explains it.

    Each ingredient that the model may lack, as creep or a mode, is fitted to the residual as a
    group of regressors, with all that the parameters of the model and a symmetric loop of another
    shape can do. A cause is named where it explains at least 15 % of the squared residual beyond
    that, and a fifth of what is not noise; or half of this alone, and half of what the loop leaves;
    and where that or what it explains alone is more than the loop does. Its criterion (Schwarz
    1978, doi 10.1214/aos/1176344136) is the lowest by 10 or more, and what it explains is more by
    2 %, or by what it leaves unexplained itself. A mode that explains no more than a delay is taken
    for one.

    Parameters
    ----------
    fit : Identification
        The fit.
    record : int, optional
        Which of several records, from 0.

    Returns
    -------
    Residual
        The residual; its causes are looked for in the first 20,000 samples of the window.

    Raises
    ------
    ParameterError
        `fit` is no result of an identification, or has no such record.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=[5.0, 15.0], weights=[0.2e-6, 0.1e-6],
    ...     creep_times=[2.0], creep_weights=[0.05],
    ... )
    >>> t = np.arange(3000) / 200.0
    >>> u = 40.0 - 40.0 * np.exp(-0.1 * t) * np.cos(2.0 * np.pi * t)
    >>> y = stage.simulate(u, 0.005).x + 20e-9 * np.random.default_rng(1).normal(size=t.size)
    >>> plays = pt.LeastSquares(creep=False, dynamics=None, dead_zones=False)
    >>> fit = pt.identify(
    ...     pt.Dataset(u=u, y=y, dt=0.005), "prandtl-ishlinskii", method=plays, drift=False
    ... )
    >>> residual_of(fit).cause
    'creep'
    """
    expect("fit", fit, Identification, "what pt.identify returns")
    places = [i for i, one in enumerate(fit.records) if one.data is not None]
    if isinstance(record, bool) or not isinstance(record, int) or record not in places:
        raise ParameterError("record", record, f"the number of a record, 0 to {len(places) - 1}")
    fitted = fit.records[record]
    data = fitted.data
    assert data is not None
    values = data.y - fit.simulate(data, offset=fitted.offset).x
    # Values between the readings are none.
    kept = np.ones(values.size, dtype=np.bool_)
    if data.left_out is not None:
        kept &= ~data.left_out
    read = data.at_readings(values)
    counts = kept if data.inserted is None else kept[~data.inserted]
    judged = np.where(counts, read, read[counts].mean())
    judged = judged - judged.mean()
    lags = max(1, min(LAGS, judged.size // 5))
    r = autocorrelation(judged, max(lags, judged.size // 4))
    n, k = judged.size, np.arange(1, lags + 1)
    portmanteau = float(n * (n + 2) * np.sum(r[1 : lags + 1] ** 2 / (n - k)))
    rate, amplitude = np.gradient(data.u, data.dt), amplitudes(data.u)
    unit = data.drive_unit
    quantities = (
        ("time", "s", data.t),
        ("drive", unit, data.u),
        ("rate", f"{unit}/s", rate),
        ("amplitude", unit, amplitude),
    )
    result = Residual(
        data=data,
        values=values,
        kept=kept,
        rate=rate,
        amplitude=amplitude,
        stroke=data.stroke,
        portmanteau=portmanteau,
        threshold=_threshold(lags),
        noise=min(sample_noise(judged), float(judged.std())),
        profiles=tuple(
            _profile(name, unit, of[kept], values[kept]) for name, unit, of in quantities
        ),
        correlations=r,
    )
    if result.is_white or int(kept.sum()) < LEAST or np.ptp(data.u) == 0.0:
        return result
    return _explained(result, fit, record)


def _explained(result: Residual, fit: Identification, record: int) -> Residual:
    """Look for the ingredients that explain a residual."""
    data, start = result.data, fit.records[record].start
    if len(data) > MOST:
        data = data[float(data.t[0]) : float(data.t[MOST])]
    here = Situation(
        fit=fit,
        data=data,
        rest=result.values[: len(data)],
        kept=result.kept[: len(data)],
        moved=start is not None and start.history != "virgin",
    )
    rest = here.rest[here.kept]
    total = float(np.sum((rest - here.own @ (here.own.T @ rest)) ** 2))
    left = float(here.null @ here.null)
    groups = explanations(here)
    if not groups or total == 0.0 or left == 0.0:
        return result
    samples = independent_samples(min(groups.values(), key=lambda one: one.squares).left)

    def ingredient(name: str, group: Explained) -> Ingredient:
        return Ingredient(
            name=name,
            share=1.0 - group.squares / total,
            gain=(left - group.squares) / total,
            alone=here.alone(group),
            count=group.fitted,
            detail=group.detail,
        )

    before = samples * float(np.log(left))
    lowered = {name: before - criterion(group, samples) for name, group in groups.items()}
    order = sorted(groups, key=lambda name: -lowered[name])
    found = {name: ingredient(name, groups[name]) for name in order}
    best = found[order[0]]
    # Two are alike where they differ by less than what the better one cannot explain either.
    noise = rest.size * result.noise**2 / total
    unexplained = max(0.0, 1.0 - best.share - noise) + UNSURE * noise
    tolerance = min(ALIKE * best.gain, unexplained)
    alike = [
        name
        for name in order
        if lowered[best.name] - lowered[name] < AHEAD or best.gain - found[name].gain < tolerance
    ]
    if "delay" in alike and "mode" in alike:
        # All that a stiff mode does to a slow drive is a delay.
        alike.remove("mode")
    first, shape = found[alike[0]], 1.0 - left / total
    systematic = max(0.0, 1.0 - noise)
    explains = first.gain > max(WORTH, SHARE * systematic) or (
        first.alone > ALONE * systematic and first.gain > ALONE * (systematic - shape)
    )
    # A loop of another shape that explains more is not named for what is left besides.
    explains = explains and max(first.gain, first.alone) > shape
    others = [name for name in order if name not in alike]
    return replace(
        result,
        candidates=tuple(found[name] for name in [*alike, *others]),
        shape=shape,
        likely=len(alike) if explains and lowered[first.name] > CLEAR else 0,
    )


def _threshold(lags: int) -> float:
    """Quantile of a chi-squared distribution of so many degrees of freedom."""
    from scipy.special import chdtri

    return float(chdtri(lags, 1.0 - CONFIDENCE))


def _profile(quantity: str, unit: str, of: Array, values: Array) -> ResidualProfile:
    """Mean and root mean square of values in bins of a quantity."""
    low, width = float(of.min()), float(np.ptp(of)) / BINS
    place = np.minimum(((of - low) / width).astype(np.intp), BINS - 1) if width else 0 * of
    place = np.asarray(place, dtype=np.intp)
    counts = np.bincount(place, minlength=BINS)
    kept = counts >= FEWEST
    sums = np.bincount(place, weights=values, minlength=BINS)[kept]
    squares = np.bincount(place, weights=values**2, minlength=BINS)[kept]
    centres = (low + width * (np.arange(BINS) + 0.5))[kept]
    count = counts[kept]
    means: Array = np.asarray(sums / count, dtype=np.float64)
    rms: Array = np.sqrt(np.asarray(squares / count, dtype=np.float64))
    return ResidualProfile(quantity, unit, np.asarray(centres, dtype=np.float64), means, rms)
