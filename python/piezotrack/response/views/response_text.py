"""Text of a frequency response."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.units import drive_text

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..response_data import FrequencyResponse

    Array = NDArray[np.float64]

__all__ = ["response_text"]

# Lines of the table.
ROWS = 12


def response_text(response: FrequencyResponse) -> str:
    """Write a frequency response as a short table, with its uncertainty.

    Parameters
    ----------
    response : FrequencyResponse
        The response.

    Returns
    -------
    str
        Several lines.
    """
    unit, scale = response.shown_unit
    size = drive_text(response.amplitude, response.drive_unit)
    mean = drive_text(response.offset, response.drive_unit)
    f, band = response.frequency, response.band()
    lines = [
        f"frequency response: {response.source or 'a record'}, {f.size} lines, "
        f"{f[0]:.4g} to {f[-1]:.4g} Hz",
        f"excitation: {response.excitation}, {size} rms about {mean}",
        *(f"note  {note}" for note in response.notes),
        f"band of 95 %: {_share(band, response.magnitude)} of the magnitude, median over the lines",
    ]
    if response.noise is not None:
        deviation = np.sqrt(response.noise)
        lines.append(f"noise: {_share(deviation, response.magnitude)}")
    if response.distortion is not None:
        deviation = np.sqrt(response.distortion)
        lines.append(
            f"nonlinear distortion of one realisation: {_share(deviation, response.magnitude)}"
        )
    if response.coherence is not None:
        lines.append(f"coherence: {np.median(response.coherence):.3f}, median over the lines")
    places = np.unique(np.geomspace(1, f.size, min(ROWS, f.size)).round().astype(int) - 1)
    lines += ["", f"{'Hz':>10} {unit:>10} {'+-':>9} {'deg':>8} {'+-':>6}"]
    for k in places:
        gain = response.magnitude[k]
        turn = np.degrees(np.arcsin(min(1.0, band[k] / gain))) if gain > 0.0 else 180.0
        lines.append(
            f"{f[k]:10.4g} {scale * gain:10.4g} {scale * band[k]:9.2g} "
            f"{np.degrees(response.phase[k]):8.1f} {turn:6.2g}"
        )
    return "\n".join(lines)


def _share(deviation: Array, magnitude: Array) -> str:
    """Write the median share of some deviations in the magnitude."""
    return f"{100.0 * np.median(deviation / magnitude):.2g} %"
