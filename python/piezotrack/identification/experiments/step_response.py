"""Conventional identification from a step response, as in section 3 of Xu and Li 2010."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from ... import _core
from ..._support.display.result import Panel, Result
from ..._support.files.writing import make_folder, result_set, save_figures, write_document
from ..._support.messages import quoted
from ...data.dataset import Dataset
from ...errors import ParameterError
from ...stages.feedback.dahl import DahlStage
from .step_readings import StepReadings

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

__all__ = ["StepResult", "StepTrace", "identify_step"]

# Relative difference of the two damping ratios above which there is a note.
APART = 0.15
# Above this zeta, (4) and (5), which are for small damping, are off by more than 2 %.
STRONG = 0.15
SETTLED = 4.0


@dataclass(frozen=True, kw_only=True, eq=False)
class StepTrace:
    """Details of a step in a record, besides the readings.

    Attributes
    ----------
    data : Dataset
        The record.
    step_time : float
        Time of the last sample before the step [s].
    end_time : float
        Time of the last sample used [s].
    rest : float
        Displacement before the step [m].
    peak_times : tuple of float
        Times of the peaks [s].
    noise : float
        Noise of the displacement [m rms].
    samples_before : int
        Samples before the step.
    cut : bool
        Whether the drive changes again after `end_time`.
    decays : float
        Length of the part used, in time constants of the ringing.
    creep : float
        Change of the displacement after the time of the steady state [m].
    frequencies, gains : ndarray
        Spectrum [Hz], [m/V].
    """

    data: Dataset
    step_time: float
    end_time: float
    rest: float
    peak_times: tuple[float, ...]
    noise: float
    samples_before: int
    cut: bool
    decays: float
    creep: float
    frequencies: Array
    gains: Array


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class StepResult(Result):
    r"""Result of a step response.

    .. math::

        \zeta = \frac{G_{dc}}{2 G_r} \;(4), \quad \omega_n = 2 \pi f \;(5), \quad
        \tau = \frac{1}{\zeta \omega_n} \;(6), \quad
        a_1 = \frac{2}{T_d} \ln \frac{P_{n-1}}{P_n} \;(9), (13)

        a_2 = \left(\frac{2 \pi}{T_d}\right)^2 + \left(\frac{a_1}{2}\right)^2 \;(10), \quad
        b_1 = G_{dc} a_2 \;(11), \quad b_0 = S_0 \;(12)

    with the overshoot P above the steady state. Xu and Li 2010, doi 10.1115/1.4001712.

    Attributes
    ----------
    readings : StepReadings
        The readings from which all else is computed.
    trace : StepTrace or None
        Details of the record they were read from; None if they were entered by hand.
    stiffness, mass : float or None
        K [N/m], M [kg]; None if no argument fixes the scale of the forces.
    piezo_coefficient, damping : float or None
        T [N/V], D [N s/m], likewise.
    scale : str
        What fixes the scale of the forces, in words.

    Notes
    -----
    (4) and (5) are for small damping: a resonance lies at
    :math:`\omega_n \sqrt{1 - 2 \zeta^2}`, 0.4 % below for zeta = 0.065. `damping_by_decrement`
    has no such limit.

    The paper reads a1 and a2 off in time, 1/s and 1/s^2, and uses the same numbers along the
    displacement, 1/m and 1/m^2; b1 takes the gain in um/V. That is a convention, not physics.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "identification.views.experiments.step_report:step_text",
        "plot": "identification.views.experiments.step_plot:plot_step_result",
        "plot_step": "identification.views.experiments.step_plot:plot_step",
        "plot_spectrum": "identification.views.experiments.step_plot:plot_spectrum",
    }

    readings: StepReadings
    trace: StepTrace | None
    stiffness: float | None
    mass: float | None
    piezo_coefficient: float | None
    damping: float | None
    scale: str

    def __repr__(self) -> str:
        return (
            f"<StepResult: {self.readings.frequency:.4g} Hz, zeta {self.damping_ratio:.3g}; "
            "see summary()>"
        )

    @cached_property
    def _mode(self) -> tuple[float, float, float, float, float, float]:
        return self.readings._core.mode()

    @property
    def overshoot_ratio(self) -> float:
        """First overshoot over the steady state."""
        return self._mode[0]

    @property
    def decrement(self) -> float:
        """Logarithmic decrement, ln of an overshoot over the next; over all peaks read."""
        return self._mode[1]

    @property
    def damping_ratio(self) -> float:
        """Zeta by the gains, equation (4)."""
        return self._mode[2]

    @property
    def damping_by_decrement(self) -> float:
        """Zeta by the logarithmic decrement d: ``d / sqrt(4 pi^2 + d^2)``."""
        return self._mode[3]

    @property
    def natural_angular_frequency(self) -> float:
        """Natural angular frequency [rad/s], equation (5)."""
        return self._mode[4]

    @property
    def time_constant(self) -> float:
        """Time constant of the decay [s], equation (6)."""
        return self._mode[5]

    @property
    def parameters(self) -> dict[str, float]:
        """The parameters that ``identify(parameters=)`` then holds: those of `hysteresis`."""
        return self.hysteresis

    @cached_property
    def hysteresis(self) -> dict[str, float]:
        """The parameters a1, a2, b1 and b0 of the Dahl operator, equations (9) to (13)."""
        return dict(zip(("a1", "a2", "b1", "b0"), self.readings._core.hysteresis(), strict=True))

    @property
    def ratios(self) -> dict[str, float]:
        """Ratios that one step determines: K/M [1/s^2], D/M [1/s] and T/K [m/V], of equation (3).

        T/K is the static gain, reduced by the hysteresis.
        """
        wn = self.natural_angular_frequency
        gain = self.readings.steady_state / self.readings.voltage
        return {"K/M": wn * wn, "D/M": 2.0 * self.damping_ratio * wn, "T/K": gain}

    @property
    def model(self) -> DahlStage | None:
        """The stage with these parameters; None if nothing fixes the scale of the forces."""
        parts = (self.mass, self.damping, self.stiffness, self.piezo_coefficient)
        if any(part is None for part in parts):
            return None
        names = ("mass", "damping", "stiffness", "piezo_coefficient")
        known: dict[str, Any] = dict(zip(names, parts, strict=True))
        return DahlStage(**known | self.hysteresis)

    @property
    def lowest_sampling_rate(self) -> float:
        """Rate to sample above [Hz]: 10 natural frequencies, and 3 in a time constant."""
        return max(10.0 * self.readings.frequency, 3.0 / self.time_constant)

    @property
    def advice(self) -> str:
        """Recommended sampling rates, in words."""
        return (
            f"sample such a stage above {self.lowest_sampling_rate:.4g} Hz (10 x the natural "
            f"frequency; 3 in a time constant are {3.0 / self.time_constant:.4g} Hz), and a closed "
            "loop above 20 x its bandwidth"
        )

    @property
    def notes(self) -> list[str]:
        """Warnings about the record and the readings, one sentence each."""
        notes = [] if self.trace is None else self._of_the_record(self.trace)
        gains, decay = self.damping_ratio, self.damping_by_decrement
        if not abs(gains - decay) <= APART * max(gains, decay):
            notes.append(
                f"the two damping ratios differ, {gains:.3g} by the gains and {decay:.3g} by the "
                "decrement: possible causes are a lag of the amplifier, a second mode or a wrong "
                "reading"
            )
        if max(gains, decay) > STRONG:
            notes.append(
                "(4) and (5) are for small damping: use the damping ratio by the decrement"
            )
        ringing = 1.0 / self.readings.period
        if not abs(ringing / self.readings.frequency - 1.0) <= 0.05:
            notes.append(
                f"the ringing, {ringing:.4g} Hz, and the resonance, "
                f"{self.readings.frequency:.4g} Hz, differ"
            )
        return notes

    def _of_the_record(self, trace: StepTrace) -> list[str]:
        notes = []
        rate = 1.0 / trace.data.dt
        if rate < self.lowest_sampling_rate:
            notes.append(f"sampled at {rate:.4g} Hz, which is slow: {self.advice}")
        if trace.decays < SETTLED:
            notes.append(
                f"the record ends {trace.decays:.2g} time constants after the step, before the "
                "ringing has died out: the damping ratio by the gains is too high"
            )
        if len(trace.peak_times) < 3:
            notes.append("only two peaks are above the noise: the decrement is that of these two")
        if trace.samples_before < 10:
            notes.append(
                "the position at rest is the mean of only "
                f"{trace.samples_before} samples before the step"
            )
        if trace.cut:
            notes.append(f"read up to {trace.end_time:.4g} s, where the drive changes again")
        if abs(trace.creep) > max(0.005 * abs(self.readings.steady_state), 2.0 * trace.noise):
            notes.append(
                f"the displacement creeps by {1e6 * trace.creep:.3g} um after the ringing settled"
            )
        return notes

    plot_step = Panel("Draw the displacement after the step, with its peaks.")
    plot_spectrum = Panel("Draw the gain over the frequency, with the resonance.")

    def document(self) -> dict[str, Any]:
        """Content of the JSON file: readings and results, SI.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {
            "format": "piezotrack-step",
            "schema_version": 1,
            "unit": "V, m, s, Hz, rad/s; a1 1/m, a2 1/m^2, b1 N/m^2, b0 N/m",
            "readings": asdict(self.readings),
            "natural_angular_frequency": self.natural_angular_frequency,
            "damping_ratio": self.damping_ratio,
            "damping_by_decrement": self.damping_by_decrement,
            "time_constant": self.time_constant,
            "hysteresis": self.hysteresis,
            "ratios": self.ratios,
            "provenance": {"package": "piezotrack", "version": _core.__version__},
        }

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write readings and results as JSON, and the picture of a record.

        Parameters
        ----------
        folder : path-like
            Where to; made where it is missing.

        Returns
        -------
        list of pathlib.Path
            ``step.json``, ``step.png`` and ``step.svg``; of readings entered by hand the first.

        Raises
        ------
        DataError
            The folder cannot be made or written to.
        """
        figures = {} if self.trace is None else {"step": self.plot()}
        with result_set(make_folder(folder)) as path:
            return [
                write_document(path / "step.json", self.document()),
                *save_figures(figures, path),
            ]


def identify_step(
    data: Dataset | StepReadings,
    *,
    stiffness: float | None = None,
    mass: float | None = None,
    second_level: tuple[float, float] | StepResult | None = None,
) -> StepResult:
    r"""Identify a stage from its step response, by the conventional method.

    The step of the drive, the steady state, the overshoot peaks and the period of the ringing
    are read from the record. The natural frequency is that of the highest gain: the Fourier
    transform of the displacement's increments over that of the drive's. `StepResult` has
    the formulas.

    One step determines K/M, D/M and T/K only. A force is fixed by one of:

    - `stiffness` or `mass`, where it is known;
    - a second static level: the published method takes the value of b1 as the scale, and solves

      .. math:: K x_i + F_h(x_i) = T u_i, \qquad i = 1, 2

      with the hysteresis force on the monotone path from rest to x. The result is sensitive to
      the small difference in gain between the two levels, so both must be measured accurately.

    Parameters
    ----------
    data : Dataset or StepReadings
        The record, its window with one step and some samples before it; or readings entered by
        hand. Missing readings are on straight lines, ``missing="drop"`` or not.
    stiffness : float, optional
        K [N/m].
    mass : float, optional
        M [kg].
    second_level : (float, float) or StepResult, optional
        Voltage [V] of another step from the same rest, and steady displacement [m].

    Returns
    -------
    StepResult
        ``pt.identify(other_log, "dahl", parameters=result.parameters)`` holds its hysteresis
        parameters.

    Raises
    ------
    DataError
        There is no step in the drive, no overshoot, or the record is too short or too coarse.
    ParameterError
        An argument has a value that cannot be used, or two of them fix the scale.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.VirtualStage.xu_li_2010(seed=1)
    >>> step = pt.identify_step(stage.record([0.0] * 100 + [75.0] * 1500, 1 / 5000.0))
    >>> print(f"{step.readings.frequency:.0f} Hz, zeta {step.damping_by_decrement:.3f}")
    159 Hz, zeta 0.065
    >>> published = pt.identify_step(pt.identification.StepReadings.xu_li_2010())
    >>> print(f"a1 = {published.hysteresis['a1']:.4f} 1/m")
    a1 = 121.9874 1/m
    """
    if isinstance(data, StepReadings):
        readings, trace = data, None
    elif isinstance(data, Dataset):
        readings, trace = _read(data)
    else:
        kind = type(data).__name__
        raise ParameterError("data", kind, "a Dataset, see pt.read, or a StepReadings")
    given = {"stiffness": stiffness, "mass": mass, "second_level": second_level}
    named = [name for name, value in given.items() if value is not None]
    if len(named) > 1:
        raise ParameterError(" and ".join(named), "given", "one, it fixes the scale", verb="are")
    core = readings._core
    wn, zeta = core.mode()[4], core.mode()[2]
    level = (readings.voltage, readings.steady_state)
    known_stiffness: float | None = None
    coefficient: float | None = None
    scale = "nothing fixes the scale of the forces"
    if second_level is not None:
        known_stiffness, coefficient = core.separate(level, _level(second_level))
        scale = "a second static level, with b1 as the scale"
    elif stiffness is not None:
        known_stiffness, scale = _positive("stiffness", stiffness, "N/m"), "the stiffness given"
    elif mass is not None:
        known_stiffness, scale = _positive("mass", mass, "kg") * wn * wn, "the mass given"
    if known_stiffness is not None and coefficient is None:
        coefficient = core.piezo_coefficient(known_stiffness, level)
    known_mass = None if known_stiffness is None else known_stiffness / (wn * wn)
    return StepResult(
        readings=readings,
        trace=trace,
        stiffness=known_stiffness,
        mass=known_mass,
        piezo_coefficient=coefficient,
        damping=None if known_mass is None else 2.0 * zeta * wn * known_mass,
        scale=scale,
    )


def _read(log: Dataset) -> tuple[StepReadings, StepTrace]:
    """Read a record in the core."""
    step = _core.read_step(log.u, log.y, log.dt, log.hold)
    voltage, steady, period, frequency, static, resonance, slope = step.readings()
    before, samples_before, end = step.samples
    rest, noise, decays, creep = step.quality
    frequencies, gains = step.spectrum()
    readings = StepReadings(
        voltage=voltage,
        steady_state=steady,
        peaks=step.peaks,
        period=period,
        frequency=frequency,
        static_gain=static,
        resonance_gain=resonance,
        initial_slope=slope,
    )
    start = float(log.t[0])
    trace = StepTrace(
        data=log,
        step_time=float(log.t[before]),
        end_time=float(log.t[end - 1]),
        rest=rest,
        peak_times=tuple(start + time for time in step.peak_times),
        noise=noise,
        samples_before=samples_before,
        cut=step.cut,
        decays=decays,
        creep=creep,
        frequencies=frequencies,
        gains=gains,
    )
    return readings, trace


def _level(second: object) -> tuple[float, float]:
    """Take a second static level as voltage [V] and displacement [m]."""
    if isinstance(second, StepResult):
        return second.readings.voltage, second.readings.steady_state
    if not isinstance(second, (tuple, list)) or len(second) != 2:
        raise ParameterError(
            "second_level",
            quoted(second),
            "(voltage in V, displacement in m) or the StepResult of another step",
        )
    voltage, displacement = second
    return (
        _core.as_number("voltage of second_level", voltage),
        _core.as_number("displacement of second_level", displacement),
    )


def _positive(name: str, value: object, unit: str) -> float:
    number = _core.as_number(name, value)
    if not 0.0 < number < math.inf:
        raise ParameterError(name, f"{number:g} {unit}", "a finite number above 0")
    return number
