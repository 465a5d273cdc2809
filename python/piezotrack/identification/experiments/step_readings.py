"""Readings of a step response, found in a record or entered by hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ... import _core
from ..._core import Conventional
from ..._support.messages import quoted
from ...errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["StepReadings"]


@dataclass(frozen=True, kw_only=True)
class StepReadings:
    """Readings of a step response, entered by hand or found by `identify_step`.

    Parameters
    ----------
    voltage : float
        Height of the step [V].
    steady_state : float
        Steady displacement, from rest [m].
    peaks : sequence of float
        Displacement at two or more consecutive overshoot peaks, from rest [m].
    period : float
        Td, period of the damped oscillation [s].
    frequency : float
        Resonance frequency in the spectrum [Hz].
    static_gain, resonance_gain : float
        Static gain, and gain at the resonance [m/V].
    initial_slope : float, optional
        S0, slope at the beginning of the response; 0 for a stage with mass.

    Raises
    ------
    ParameterError
        A value is not a number or is out of its range, or the peaks do not decrease.

    Examples
    --------
    >>> import piezotrack as pt
    >>> published = pt.identification.StepReadings.from_um(
    ...     voltage=75.0, steady_state=117.7622, peaks=(192.5302, 170.2524), period=0.0058,
    ...     frequency=160.0, static_gain=1.5759, resonance_gain=12.0806,
    ... )
    >>> published == pt.identification.StepReadings.xu_li_2010()
    True
    """

    voltage: float
    steady_state: float
    peaks: Sequence[float]
    period: float
    frequency: float
    static_gain: float
    resonance_gain: float
    initial_slope: float = 0.0

    def __post_init__(self) -> None:
        for name in (
            "voltage",
            "steady_state",
            "period",
            "frequency",
            "static_gain",
            "resonance_gain",
            "initial_slope",
        ):
            object.__setattr__(self, name, _core.as_number(name, getattr(self, name)))
        try:
            values = list(self.peaks)
        except TypeError:
            raise ParameterError("peaks", quoted(self.peaks), "several numbers") from None
        peaks = tuple(_core.as_number(f"peaks[{k}]", value) for k, value in enumerate(values))
        object.__setattr__(self, "peaks", peaks)
        _ = self._core

    @property
    def _core(self) -> Conventional:
        """The formulas in the core, which checks every number."""
        return Conventional(
            voltage=self.voltage,
            steady_state=self.steady_state,
            peaks=list(self.peaks),
            period=self.period,
            frequency=self.frequency,
            static_gain=self.static_gain,
            resonance_gain=self.resonance_gain,
            initial_slope=self.initial_slope,
        )

    @classmethod
    def from_um(
        cls,
        *,
        voltage: float,
        steady_state: float,
        peaks: Sequence[float],
        period: float,
        frequency: float,
        static_gain: float,
        resonance_gain: float,
    ) -> StepReadings:
        """Take readings in micrometres.

        Parameters
        ----------
        voltage : float
            Height of the step [V].
        steady_state : float
            Steady displacement, from rest [um].
        peaks : sequence of float
            Displacement at the overshoot peaks [um].
        period : float
            Period of the damped oscillation [s].
        frequency : float
            Resonance frequency [Hz].
        static_gain, resonance_gain : float
            Gains [um/V].

        Returns
        -------
        StepReadings
            In SI.
        """

        def metres(name: str, value: float) -> float:
            return _core.as_number(name, value) / 1e6

        return cls(
            voltage=voltage,
            steady_state=metres("steady_state", steady_state),
            peaks=[metres(f"peaks[{k}]", value) for k, value in enumerate(peaks)],
            period=period,
            frequency=frequency,
            static_gain=metres("static_gain", static_gain),
            resonance_gain=metres("resonance_gain", resonance_gain),
        )

    @classmethod
    def xu_li_2010(cls) -> StepReadings:
        """Section 3.1 and 3.2 of Xu and Li 2010, doi 10.1115/1.4001712.

        Returns
        -------
        StepReadings
            Of the x axis under 75 V.
        """
        return cls.from_um(
            voltage=75.0,
            steady_state=117.7622,
            peaks=(192.5302, 170.2524),
            period=0.0058,
            frequency=160.0,
            static_gain=1.5759,
            resonance_gain=12.0806,
        )
