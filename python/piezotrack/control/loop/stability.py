"""Stability and margins of the sampled loop of a controller and a stage."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from ... import _core
from ..._support.arguments import expect, not_negative, one_of
from ..._support.display.result import Result
from ..._support.units import decibels, shown_unit
from ...errors import ParameterError
from ..controller.controller import Controller
from ..laws.state_space import StateSpace
from ..plant import linearised_plants, plant_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from ...identification.fitted.identified_model import IdentifiedModel
    from ..plant import Plant

    Array = NDArray[np.float64]

__all__ = ["LoopCheck", "LoopReport", "LoopResponse", "check_loop"]

# Frequencies of the grids, each within an interval of the one before, that find the bandwidth.
GRIDS = (150, 40, 40)
Gain = Literal["low", "middle", "high"]
GAINS: tuple[Gain, ...] = ("low", "middle", "high")


@dataclass(frozen=True, kw_only=True)
class LoopCheck:
    """Stability of the loop at one gain of the stage.

    Attributes
    ----------
    gain : float
        Static gain of the stage for small motions [m/V].
    stable : bool
        Whether the loop is stable.
    exact : bool
        Whether that was decided by counting roots; for periods above 10 000 samples it is decided
        by the small-gain bound, which is sufficient but not necessary.
    gain_margin : float or None
        Factor on the gain at the stability limit of the feedback without the repetitive part;
        below 1 where the feedback is unstable; None where there is no such gain.
    stable_gains : tuple of (float, float) or None
        Factors on the gain of the stage between which the whole loop is stable, the upper one
        `inf` where there is none; for an unstable loop the nearest such range. None where no
        gain makes it stable, and with a repetitive part of more than 10 000 samples.
    phase_margin : float or None
        Phase margin of the feedback without the repetitive part [rad]; None where its gain is
        never 1.
    delay_margin : float or None
        Delay that makes the feedback unstable [s], in whole samples. A fraction of a sample also
        shifts the samples along the ringing of a fast mode, which can destabilise the loop much
        sooner: use `check_loop` with that delay.
    crossover : float or None
        Highest frequency at which its gain is 1 [Hz].
    bandwidth : float or None
        Lowest frequency at which the closed loop of the feedback without feedforward and
        repetitive part is 3 dB below 1 [Hz]: L/(1 + L), or P C/(1 + L) of a law in which only a
        part C of what closes the loop tracks, as beside damping and a hysteresis observer. None of
        an unstable loop, of one that is below at low frequencies already, and of one that never is.
    sensitivity : float
        Ms, the largest amplification of a disturbance.
    slowest_root : float or None
        Largest radius of a root of the whole loop.
    periods : float or None
        Periods after which 1/e of an error remains; None without a repetitive part.
    small_gain : float or None
        Largest share of an error that remains after a period, by the small-gain bound: below 1 is
        sufficient for stability at any period, but not necessary.
    hidden_roots : int
        Roots at exactly 1 that are not observable in the error: uRC and uFB drift against each
        other.
    hint : str or None
        Probable mistake in the gain.
    drive_unit : str
        Unit of the drive, for what is printed.
    """

    gain: float
    stable: bool
    exact: bool
    gain_margin: float | None
    stable_gains: tuple[float, float] | None
    phase_margin: float | None
    delay_margin: float | None
    crossover: float | None
    bandwidth: float | None
    sensitivity: float
    slowest_root: float | None
    periods: float | None
    small_gain: float | None
    hidden_roots: int
    hint: str | None
    drive_unit: str = "V"

    @property
    def gain_text(self) -> str:
        """The gain with its unit, such as 1.5 um/V."""
        unit, scale = shown_unit(self.drive_unit)
        return f"{1e6 * self.gain / scale:.3g} um/{unit}"

    def __str__(self) -> str:
        text = f"{self.gain_text}: {'stable' if self.stable else 'UNSTABLE'}"
        text += self._gains()
        # With a repetitive part these are margins of another loop: of the feedback alone.
        of = "" if self.small_gain is None else " of the feedback"
        if self.stable and self.phase_margin is not None:
            text += f", phase margin{of} {math.degrees(self.phase_margin):.3g} deg"
        if self.stable:
            text += f", Ms{of} {self.sensitivity:.3g}"
        if self.bandwidth is not None:
            text += f", bandwidth{of} {self.bandwidth:.3g} Hz"
        if self.periods is not None:
            text += f", learns in {self.periods:.2g} periods"
        return text

    def margins(self) -> dict[str, Any]:
        """Margins as plain numbers, with their units in the names.

        Returns
        -------
        dict
            Of numbers, truths and None only.
        """
        return {
            f"plant_gain_m_per_{self.drive_unit}": self.gain,
            "stable": self.stable,
            "gain_margin_dB": None if self.gain_margin is None else decibels(self.gain_margin),
            "phase_margin_deg": (
                None if self.phase_margin is None else math.degrees(self.phase_margin)
            ),
            "delay_margin_s": self.delay_margin,
            "crossover_Hz": self.crossover,
            "bandwidth_Hz": self.bandwidth,
            "sensitivity": self.sensitivity,
            "learning_periods": self.periods,
        }

    def _gains(self) -> str:
        """Describe where the whole loop is stable."""
        if self.stable_gains is None:
            return ", at any gain" if self.exact and not self.stable else ""
        low, high = self.stable_gains
        if low > 1.0:
            return f", stable from {low:.3g} times the gain on"
        return f", gain margin {decibels(high):.3g} dB" if math.isfinite(high) else ""


@dataclass(frozen=True, kw_only=True)
class LoopResponse:
    """Frequency response of the loop.

    Attributes
    ----------
    frequency : ndarray, shape (n,)
        Frequencies [Hz].
    open_loop, sensitivity, complementary : ndarray of complex, shape (n,)
        L, 1/(1 + L) and L/(1 + L) of the whole loop, the last as `LoopCheck.bandwidth` has it.
    learning : ndarray, shape (n,)
        Share of an error that remains after a period; 0 without a repetitive part.
    """

    frequency: Array
    open_loop: NDArray[np.complex128]
    sensitivity: NDArray[np.complex128]
    complementary: NDArray[np.complex128]
    learning: Array

    @property
    def phase(self) -> Array:
        """Phase of the open loop without jumps of a turn [rad], shape (n,)."""
        return np.unwrap(np.angle(self.open_loop))


@dataclass(frozen=True, kw_only=True, eq=False)
class LoopReport(Result):
    """Stability of the loop at the lowest, a middle and the highest small-signal gain of a stage.

    With hysteresis the gain depends on the path: it is least just after a reversal.

    Attributes
    ----------
    controller : Controller
        The controller.
    low, middle, high : LoopCheck
        Stability at these gains.
    plants : tuple of LoopPlant
        The stage linearised at these gains, as objects of the core.
    """

    views: ClassVar[Mapping[str, str]] = {
        "summary": "control.views.stability_text:loop_text",
        "plot": "control.views.stability_plot:plot_loop_report",
    }

    controller: Controller
    low: LoopCheck
    middle: LoopCheck
    high: LoopCheck
    plants: tuple[_core.LoopPlant, ...]

    @property
    def stable(self) -> bool:
        """Whether the loop is stable at the middle gain."""
        return self.middle.stable

    @property
    def everywhere(self) -> bool:
        """Whether it is stable at all three."""
        return self.low.stable and self.middle.stable and self.high.stable

    def __repr__(self) -> str:
        elsewhere = "" if self.everywhere == self.stable else "; not at every gain of the stage"
        return f"<LoopReport at {self.middle}{elsewhere}>"

    @property
    def holds_state(self) -> bool:
        """Whether the law in state space keeps its state while the command is clipped.

        No gain of back-calculation is stable then.
        """
        law = self.controller.feedback
        coefficients = dict(self.controller._core.coefficients())
        return isinstance(law, StateSpace) and "back" not in coefficients

    @property
    def controllers(self) -> tuple[Controller]:
        """The controller, as a tuple."""
        return (self.controller,)

    @property
    def cases(self) -> tuple[tuple[Gain, LoopCheck], ...]:
        """Name and stability at each gain."""
        return ("low", self.low), ("middle", self.middle), ("high", self.high)

    def design(self) -> dict[str, Any]:
        """Margins for the file of the controller, at all three gains.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        law = {"by": "check_loop"} | ({"antiwindup": "held state"} if self.holds_state else {})
        return law | {name: case.margins() for name, case in self.cases}

    def response(self, count: int = 400, *, gain: Gain = "middle") -> LoopResponse:
        """Frequency response up to half the sampling rate.

        Parameters
        ----------
        count : int, optional
            Frequencies, evenly spaced in their logarithm.
        gain : {"low", "middle", "high"}, optional
            Gain of the stage.

        Returns
        -------
        LoopResponse
            The curves.
        """
        highest = 0.499 / self.controller.dt
        count = max(2, _core.as_count("count", count))
        if count > 100_000:
            raise ParameterError("count", count, "100000 at most")
        frequency = np.geomspace(1e-3 * highest, highest, count)
        one_of("gain", gain, GAINS)
        plant = self.plants[GAINS.index(gain)]
        curves = _core.loop_response(self.controller._core, plant, frequency.tolist())
        *pairs, learning = curves
        loop, sensitivity, complementary = (
            np.asarray(pair) @ np.array([1.0, 1.0j]) for pair in pairs
        )
        return LoopResponse(
            frequency=frequency,
            open_loop=loop,
            sensitivity=sensitivity,
            complementary=complementary,
            learning=np.asarray(learning),
        )


def check_loop(
    stage: Plant | IdentifiedModel,
    controller: Controller,
    *,
    delay: float = 0.0,
) -> LoopReport:
    """Stability and margins of a controller on a stage.

    The stage is linearised for small motions: one with hysteresis in feedback with the slope of
    the hysteresis force as a spring; one with hysteresis at the input with the slope of its output
    on the settled loop between the limits, without creep. Bandwidth of the amplifier and delay of
    the sensor of a virtual stage are included. The voltage is held between samples, and the
    repetitive part is that of the implementation, with all its taps.

    Parameters
    ----------
    stage : Stage, VirtualStage or IdentifiedModel
        The plant: any stage of ``pt.stages``, a `VirtualStage` or an `IdentifiedModel`, whose
        delay is included.
    controller : Controller
        The controller.
    delay : float, optional
        Time from a reading to the effect of its voltage [s], besides the hold.

    Returns
    -------
    LoopReport
        At the lowest, a middle and the highest gain of the stage.

    Examples
    --------
    >>> import piezotrack as pt
    >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.xu_li_2010())
    >>> report = pt.check_loop(pt.VirtualStage.xu_li_2010(), loop)
    >>> report.stable
    True
    """
    expect("controller", controller, Controller, "pt.Controller")
    more = not_negative("delay", delay, "s")
    plants = linearised_plants(plant_of(stage), controller.limits, more)
    cases = [_check(controller, linear) for linear in plants]
    return LoopReport(
        controller=controller, low=cases[0], middle=cases[1], high=cases[2], plants=tuple(plants)
    )


def _check(controller: Controller, plant: _core.LoopPlant) -> LoopCheck:
    loop = _core.check_loop(controller._core, plant)
    slowest, margin = loop["slowest"], loop["gain_margin"]
    feedback = replace(controller, repetitive=None)
    bandwidth = _bandwidth(feedback, plant) if loop["stable"] else None
    return LoopCheck(
        gain=plant.static_gain,
        stable=loop["stable"],
        exact=loop["exact"],
        gain_margin=None if margin is None or math.isinf(margin) else margin,
        stable_gains=loop["gains"],
        phase_margin=loop["phase_margin"],
        delay_margin=loop["delay_margin"],
        crossover=loop["crossover"],
        bandwidth=bandwidth,
        sensitivity=loop["sensitivity"],
        slowest_root=None if slowest is None else slowest[0],
        periods=loop["periods"],
        small_gain=loop["small_gain"],
        hidden_roots=loop["hidden"],
        hint=loop["hint"],
        drive_unit=controller.drive_unit,
    )


def _bandwidth(feedback: Controller, plant: _core.LoopPlant) -> float | None:
    """Return the lowest frequency at which a closed loop is 3 dB below 1 [Hz], on finer grids."""
    low, high = 1e-6 / feedback.dt, 0.4999 / feedback.dt
    for count in GRIDS:
        frequency = np.geomspace(low, high, count)
        pairs = _core.loop_response(feedback._core, plant, frequency.tolist())[2]
        size = np.hypot(*np.asarray(pairs).T)
        below = np.flatnonzero(size < math.sqrt(0.5))
        if not below.size or below[0] == 0:
            return None
        low, high = frequency[below[0] - 1], frequency[below[0]]
    return math.sqrt(low * high)
