"""Frequency response of records that do not repeat, with their coherence."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .._support.arguments import hertz
from ..errors import ParameterError
from .response_data import FrequencyResponse

if TYPE_CHECKING:
    from ..data.dataset import Dataset

__all__ = ["from_nonperiodic"]

# Segments of a log by default, and at least.
SEGMENTS, FEWEST = 16, 3
# Independent averages in one of Hann windows that overlap by half (Welch 1967).
INDEPENDENT = 18.0 / 19.0
# Power of the drive, relative to its largest, below which a frequency is not excited.
EXCITED = 1e-6


def from_nonperiodic(logs: list[Dataset], resolution: float | None) -> FrequencyResponse:
    r"""Estimate the response by Welch's method, with the variance that the coherence gives.

    .. math:: \hat G = \frac{S_{yu}}{S_{uu}}, \qquad
        \sigma^2 = |\hat G|^2 \frac{1 - \gamma^2}{\gamma^2 (n - 1)}

    with n independent averages. Bendat and Piersol, Random Data, 4th ed., 2010, section 9.2.

    Parameters
    ----------
    logs : list of Dataset
        Of one sampling interval.
    resolution : float or None
        Distance of the frequencies [Hz].

    Returns
    -------
    FrequencyResponse
        Where the drive has power.

    Raises
    ------
    ParameterError
        `resolution` leaves fewer than three segments.
    DataError
        The drive does not move.
    """
    first = logs[0]
    longest = min(len(log) for log in logs)
    segments = (
        2.0 * longest / SEGMENTS
        if resolution is None
        else (1.0 / (hertz("resolution", resolution) * first.dt))
    )
    count = round(segments)
    averages = sum(max(0, (len(log) - count) // (count - count // 2) + 1) for log in logs)
    if count < 8 or averages < FEWEST:
        raise ParameterError(
            "resolution",
            f"{1.0 / (count * first.dt):.4g} Hz",
            f"{4.0 / (longest * first.dt):.3g} to {0.1 / first.dt:.3g} Hz for logs of this length",
        )
    suu, syy, syu = (
        sum(parts) for parts in zip(*(_powers(log, count) for log in logs), strict=True)
    )
    kept = suu > EXCITED * suu[1:].max(initial=0.0)
    kept[[0, -1]] = False
    suu, syy, syu = suu[kept], syy[kept], syu[kept]
    value = syu / suu
    coherence = np.square(np.abs(syu)) / (suu * syy)
    independent = max(2.0, INDEPENDENT * averages)
    left = np.maximum(syy - np.square(np.abs(syu)) / suu, 0.0)
    drive = np.concatenate([log.u for log in logs])
    return FrequencyResponse(
        frequency=np.flatnonzero(kept) / (count * first.dt),
        value=value,
        variance=left / suu / (independent - 1.0),
        degrees=round(2.0 * (independent - 1.0)),
        coherence=coherence,
        dt=first.dt,
        amplitude=float(drive.std()),
        offset=float(drive.mean()),
        drive_unit=first.drive_unit,
        excitation=f"{averages} segments of {count * first.dt:.4g} s, not periodic",
        source=first.source,
        notes=(
            "the drive does not repeat: noise and nonlinear distortion are not distinguished, and "
            "leakage lowers peaks that are narrower than the resolution",
        ),
    )


def _powers(log: Dataset, count: int) -> tuple[Any, Any, Any]:
    """Return power densities of drive and displacement, and their cross density, summed."""
    from scipy.signal import csd, welch

    options: Any = {"fs": 1.0 / log.dt, "nperseg": count, "detrend": "linear"}
    _, suu = welch(log.u, **options)
    _, syy = welch(log.y, **options)
    _, syu = csd(log.u, log.y, **options)
    weight = (len(log) - count) // (count - count // 2) + 1
    return weight * suu, weight * syy, weight * syu
