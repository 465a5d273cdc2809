"""PID gains scheduled by amplitude and rate of the reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from ..._support.arguments import positive
from ...errors import ParameterError
from ..parts.part import FeedbackLaw, part
from .pid import Pid

__all__ = ["MOST_GRADES", "ScheduledPid"]

# Most amplitudes, and most rates.
MOST_GRADES = 4


@part("scheduled-pid")
@dataclass(frozen=True, kw_only=True)
class ScheduledPid(FeedbackLaw):
    """PID whose gains follow amplitude and rate of the reference, without a bump.

    Xu and Li 2010, conclusion, doi 10.1115/1.4001712, name it as future work. At each turning point
    of the reference, amplitude and rate are those of the half wave that ends there; the gains are
    interpolated linearly in the logarithms of both, and kept until the next turning point. Beyond
    the grid they are those at its end. `pt.schedule` tunes one.

    `check_loop` and `to_control` take the gains at `first`.

    Parameters
    ----------
    amplitudes : sequence of float
        Half of peak to peak [m], rising, 1 to 4 of them.
    rates : sequence of float
        Frequencies [Hz], rising, 1 to 4 of them.
    gains : sequence of Pid
        For each amplitude the gains at each rate.
    first : (float, float), optional
        Amplitude [m] and rate [Hz] until the first whole half wave has ended; default the largest
        amplitude and the lowest rate.

    Raises
    ------
    ParameterError
        A number is out of its range, or the gains are not as many as amplitudes times rates.

    Examples
    --------
    >>> import piezotrack as pt
    >>> slow, fast = pt.Pid.from_um(kp=0.2, ti=0.02), pt.Pid.from_um(kp=0.1, ti=0.02)
    >>> law = pt.control.ScheduledPid(amplitudes=[10e-6], rates=[0.1, 1.0], gains=[slow, fast])
    >>> pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=law)
    Controller(scheduled PID, 50 Hz, 0 to 75 V)
    """

    amplitudes: Sequence[float]
    rates: Sequence[float]
    gains: Sequence[Pid]
    first: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        amplitudes = _axis("amplitudes", self.amplitudes, "m")
        rates = _axis("rates", self.rates, "Hz")
        gains = tuple(self.gains) if isinstance(self.gains, Sequence) else ()
        if len(gains) != len(amplitudes) * len(rates) or not all(
            isinstance(one, Pid) for one in gains
        ):
            raise ParameterError(
                "gains",
                f"{len(gains)} entries",
                f"{len(amplitudes) * len(rates)} pt.Pid, one for each amplitude and rate",
                verb="has",
            )
        first = self.first or (amplitudes[-1], rates[0])
        if not isinstance(first, Sequence) or len(first) != 2:
            raise ParameterError("first", f"{self.first!r}", "(amplitude in m, rate in Hz)")
        first = (positive("first[0]", first[0], "m"), positive("first[1]", first[1], "Hz"))
        checked = {"amplitudes": amplitudes, "rates": rates, "gains": gains, "first": first}
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def _lengths(self) -> tuple[int, ...]:
        return len(self.amplitudes), len(self.rates)


def _axis(name: str, values: object, unit: str) -> tuple[float, ...]:
    listed = values.tolist() if hasattr(values, "tolist") else values
    if not isinstance(listed, Sequence) or not 1 <= len(listed) <= MOST_GRADES:
        raise ParameterError(name, f"{values!r}", f"1 to {MOST_GRADES} values in {unit}")
    axis = tuple(positive(name, one, unit) for one in listed)
    if any(after <= before for before, after in pairwise(axis)):
        raise ParameterError(name, axis, "them in rising order", verb="are")
    return axis
