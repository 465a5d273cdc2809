"""Choice of the drive to measure next, whose record determines the parameters best."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from .... import _core
from ...._support.arguments import expect, number_pair, plain, positive
from ...._support.arrays import check_dt
from ...._support.display.result import Result
from ...._support.files.writing import write_columns
from ...._support.units import drive_word, of_drive, shown_unit
from ....errors import ParameterError
from ....stages.base import Stage
from ...fitted.identification import Identification
from ...fitted.identified_model import IdentifiedModel
from .blocks import Span
from .information import Truth
from .search import COUNTS, FEWEST, DriveSearch

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["ExpectedDeviation", "SuggestedDrive", "suggest_drive"]

# Deviations of a 95 % interval.
NORMAL_95 = 1.959963984540054
# Correlation of neighbouring residuals from which on they are not taken for independent.
CORRELATED = 0.3
# Samples of a drive at most: the response of the stage is computed for each parameter.
MOST_SAMPLES = 1_000_000


class ExpectedDeviation(NamedTuple):
    """Spread of one parameter that a record would leave.

    Attributes
    ----------
    value : float
        The value taken for true, in `unit`.
    unit : str
        SI; empty where there is none.
    deviation : float
        Standard deviation with the suggested drive; infinite above five times the value.
    of_sine : float
        With a plain sine over the limits, of the same length.
    of_record : float or None
        With the record that was fitted; None where there is none.
    """

    value: float
    unit: str
    deviation: float
    of_sine: float
    of_record: float | None = None

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the 95 % interval, of a normal distribution."""
        half = NORMAL_95 * self.deviation
        return self.value - half, self.value + half


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SuggestedDrive(Result):
    """A drive, and what a record of it would tell of a stage.

    Attributes
    ----------
    u : ndarray, shape (n,)
        Drive [V].
    dt : float
        Sampling interval [s].
    limits : (float, float)
        Lowest and highest drive [V].
    slew : float
        Largest rate [V/s].
    blocks : tuple of str
        What it is composed of, in turn.
    sine : ndarray, shape (n,)
        The plain sine that it is compared with [V].
    parameters : dict of str to ExpectedDeviation
        Spread of each parameter that would be fitted, entries of a list by their number.
    noise : float
        Noise of the displacement taken for the deviations [m rms]; white.
    drive_unit : str
        Unit of the drive, SI.
    seed : int
        Of the random steps.
    notes : tuple of str
        Remarks on a drive beyond the record identified.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "identification.views.confidence.suggested_drive_report:suggested_text",
        "plot": "identification.views.confidence.suggested_drive_plot:plot_suggested",
    }

    u: Array
    dt: float
    limits: tuple[float, float]
    slew: float
    blocks: tuple[str, ...]
    sine: Array
    parameters: Mapping[str, ExpectedDeviation]
    noise: float
    drive_unit: str
    seed: int
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<SuggestedDrive, {self.u.size} samples in {plain(self.u.size * self.dt)} s>"

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write time and drive as a CSV file, which ``piezotrack measure`` plays.

        Parameters
        ----------
        path : path-like
            The file.

        Returns
        -------
        pathlib.Path
            The file.

        Raises
        ------
        DataError
            The file cannot be written.
        """
        name, scale = shown_unit(self.drive_unit)
        time = self.dt * np.arange(self.u.size)
        drive = f"{drive_word(self.drive_unit)}_{name}"
        return write_columns(path, {"time_s": time, drive: scale * self.u})

    def document(self) -> dict[str, Any]:
        """Content of the JSON file.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {
            "format": "piezotrack-suggested-drive",
            "schema_version": 1,
            "samples": self.u.size,
            "dt": {"value": self.dt, "unit": "s"},
            "limits": {"value": list(self.limits), "unit": self.drive_unit},
            "slew": {"value": self.slew, "unit": f"{self.drive_unit}/s"},
            "noise": {"value": self.noise, "unit": "m"},
            "blocks": list(self.blocks),
            "parameters": {
                name: {
                    "value": one.value,
                    "unit": one.unit,
                    "standard_deviation": one.deviation,
                    "interval_95": list(one.interval),
                    "standard_deviation_of_sine": one.of_sine,
                    "standard_deviation_of_record": one.of_record,
                }
                for name, one in self.parameters.items()
            },
            "notes": list(self.notes),
            "provenance": {
                "package": "piezotrack",
                "version": _core.__version__,
                "seed": self.seed,
            },
        }


def suggest_drive(
    model: IdentifiedModel | Stage,
    *,
    limits: tuple[float, float],
    slew: float,
    seconds: float,
    dt: float,
    noise: float | None = None,
    seed: int = 0,
) -> SuggestedDrive:
    r"""Choose the drive of which a record determines the parameters of a model best.

    With the sensitivities :math:`J_{tj} = \partial x_t / \partial \ln \theta_j` of the displacement
    to the values that are fitted, by central differences, and after offset and drift of the sensor
    are projected out of them, the determinant

    .. math:: \log \det \left(\frac{J^T J}{\sigma^2} + \frac{I}{10^2}\right)

    is maximised (D-optimality: Goodwin and Payne 1977, Dynamic System Identification, section 6.2).
    The drive is a sequence of blocks, 4, 8 or 16 of equal length: sines, growing and shrinking
    triangles, a fast sine upon a slow one, sweeps, random steps, ramps and rests. They are chosen
    one after the other, each for the largest determinant so far, and then exchanged one by one
    (Fedorov 1972, Theory of Optimal Experiments, chapter 3). With many samples and
    values the blocks are judged by every second to tenth sample. The deviations are
    :math:`\sigma \sqrt{[(J^T J)^{-1}]_{jj}}`: the Cramer-Rao bound under white noise, as far as the
    model is right.

    Parameters
    ----------
    model : IdentifiedModel or Stage
        What is taken for true: a fit, whose free values count, or a stage, of which those count
        that `identify` fits: a stage with a voltage at its input has a nominal stiffness, and
        thresholds and times of creep are chosen beforehand. Values of 0 are left out.
    limits : (float, float)
        Lowest and highest drive [V].
    slew : float
        Largest rate of the drive [V/s].
    seconds : float
        Length [s].
    dt : float
        Sampling interval [s].
    noise : float, optional
        Noise of the displacement [m rms]. Of a fit it is that of the residual; where neighbouring
        residuals correlate by r above 0.3, times ``sqrt((1 + r) / (1 - r))``.
    seed : int, optional
        Of the random steps among the blocks.

    Returns
    -------
    SuggestedDrive
        It begins and ends at 0 V, or the limit nearest to it.

    Raises
    ------
    ParameterError
        `model` is neither, or has nothing to fit; `limits` are reversed; `slew` does not lead over
        the range and back in `seconds`; `seconds` are too few samples; or a stage has no `noise`.
    NumericalError
        The stage cannot be simulated under any of the blocks.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.stages.PrandtlIshlinskiiStage(
    ...     linear=1e-6, thresholds=[10.0, 20.0], weights=[0.2e-6, 0.1e-6], time_constant=2e-3
    ... )
    >>> found = pt.suggest_drive(
    ...     stage, limits=(0.0, 75.0), slew=2000.0, seconds=4.0, dt=2e-3, noise=20e-9
    ... )
    >>> lag = found.parameters["time_constant"]
    >>> lag.deviation < 0.2 * lag.of_sine
    True
    """
    expect("model", model, (IdentifiedModel, Stage), "what pt.identify or pt.load returns, a stage")
    unit = model.drive_unit if isinstance(model, IdentifiedModel) else model.info.drive_unit
    low, high = number_pair("limits", limits, unit)
    slew, seconds = positive("slew", slew, f"{unit}/s"), positive("seconds", seconds, "s")
    dt, seed = check_dt(dt), _core.as_count("seed", seed)
    if seconds < (shortest := COUNTS[0] * FEWEST * dt):
        raise ParameterError(
            "seconds", f"{seconds:g} s", f"{shortest:g} s or more at intervals of {dt:g} s"
        )
    if seconds > MOST_SAMPLES * dt:
        raise ParameterError(
            "seconds",
            f"{seconds:g} s",
            f"{MOST_SAMPLES * dt:g} s or less, {MOST_SAMPLES} intervals of {dt:g} s",
        )
    if slew * seconds < 4.0 * (high - low):
        raise ParameterError(
            "slew",
            f"{slew:g} {unit}/s",
            f"{4.0 * (high - low) / seconds:g} {unit}/s or more: twice over the limits and back "
            f"in {seconds:g} s",
        )
    span = Span(low, high, slew * dt)
    truth = Truth.of(model)
    sigma = _noise_of(model, noise)
    search = DriveSearch(truth, span, round(seconds / dt), dt, sigma, seed)
    plan = max((search.plan(count) for count in search.counts()), key=lambda one: one.score)
    u = search.whole(plan)
    sine = search.sine()
    spreads = [truth.spread(truth.gram(one, dt), sigma) for one in (u, sine)]
    earlier = truth.spread_of_records(model, sigma) if isinstance(model, Identification) else None
    parameters = {
        name: ExpectedDeviation(
            value,
            of_drive(unit_of, unit),
            abs(value) * float(spreads[0][j]),
            abs(value) * float(spreads[1][j]),
            None if earlier is None else abs(value) * float(earlier[j]),
        )
        for j, (name, value, unit_of) in enumerate(truth.values)
    }
    beyond = model.extrapolation_notes(u, dt) if isinstance(model, IdentifiedModel) else []
    return SuggestedDrive(
        u=u,
        dt=dt,
        limits=(low, high),
        slew=slew,
        blocks=tuple(search.blocks[len(plan.chosen)][k].text for k in plan.chosen),
        sine=sine,
        parameters=parameters,
        noise=sigma,
        drive_unit=unit,
        seed=seed,
        notes=tuple(beyond),
    )


def _noise_of(model: IdentifiedModel | Stage, noise: float | None) -> float:
    """Return the noise given, or that of the residual of a fit [m]."""
    if noise is not None:
        return positive("noise", noise, "m")
    if isinstance(model, Stage):
        raise ParameterError(
            "noise", "None", "that of the sensor, in m rms, as the model is a stage"
        )
    if isinstance(model, Identification):
        r = min(max(model.autocorrelations), 1.0 - 1e-9)
        return model.cost * (math.sqrt((1.0 + r) / (1.0 - r)) if r > CORRELATED else 1.0)
    cost = model.details.get("fit", {}).get("cost", {}).get("value")
    if not (isinstance(cost, float) and cost > 0.0):
        raise ParameterError("noise", "None", "a number in m, as the model file has no residual")
    return cost
