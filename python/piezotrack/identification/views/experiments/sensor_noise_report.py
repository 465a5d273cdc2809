"""Table of a sensor at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ...experiments.sensor_noise import Noise

__all__ = ["noise_text"]


def noise_text(noise: Noise) -> str:
    """Write the figures of a sensor at rest as a table.

    Parameters
    ----------
    noise : Noise
        The figures.

    Returns
    -------
    str
        Several lines.
    """
    data = noise.data
    steps = f"{1e6 * noise.resolution:.5g} um, {noise.levels} levels seen"
    colour = "white, as far as this sampling rate shows"
    if noise.bandwidth_sd is not None:
        colour = f"low-pass of {noise.bandwidth:.4g} +- {noise.bandwidth_sd:.2g} Hz"
    return "\n".join(
        [
            f"at rest: {data.source or 'a record'}, {len(data)} samples, "
            f"{data.duration:.4g} s at {1.0 / data.dt:.6g} Hz",
            *(f"note  {note}" for note in noise.notes),
            f"rms           {1e6 * noise.rms:.5g} um about the drift",
            f"peak to peak  {1e6 * noise.spread.peak_to_peak:.5g} um",
            f"drift         {1e6 * noise.drift:.4g} um over the record",
            f"steps         {steps if noise.resolution else 'none found'}",
            f"noise model   {1e6 * noise.noise:.5g} um rms before the steps, {colour}",
        ]
    )
