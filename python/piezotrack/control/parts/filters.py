"""Filters of the measurement."""

from __future__ import annotations

from dataclasses import dataclass

from ..._support.arguments import in_range, positive
from .part import Part, part

__all__ = ["Filter", "LowPass", "Notch"]


@dataclass(frozen=True, eq=False)
class Filter(Part):
    """Base class of the filters of the measurement."""


@part("low-pass")
@dataclass(frozen=True)
class LowPass(Filter):
    """First-order low-pass on the measurement.

    Parameters
    ----------
    cutoff : float
        Frequency at which half of the power passes [Hz].
    """

    cutoff: float

    def __post_init__(self) -> None:
        positive("cutoff", self.cutoff, "Hz")


@part("notch")
@dataclass(frozen=True)
class Notch(Filter):
    """Notch on the measurement.

    Parameters
    ----------
    frequency : float
        Its middle [Hz], below half the sampling rate.
    width : float, optional
        Damping ratio of its poles.
    depth : float, optional
        Gain in the middle, 0 to 1.
    """

    frequency: float
    width: float = 0.5
    depth: float = 0.0

    def __post_init__(self) -> None:
        positive("frequency", self.frequency, "Hz")
        positive("width", self.width, "parts of the frequency")
        in_range("depth", self.depth, 1.0, "parts of 1")
