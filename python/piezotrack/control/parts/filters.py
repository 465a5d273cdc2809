"""Filters of the measurement."""

from __future__ import annotations

from dataclasses import dataclass

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
        Frequency at which half of the power passes [Hz], at most half the sampling rate.
    """

    cutoff: float


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
