"""Text of the modes of a frequency response."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

from ..._support.units import drive_text

if TYPE_CHECKING:
    from ..modal_fit import ModalFit

__all__ = ["modal_text"]

# Misfit from which the modes do not describe the response.
APART = 1.3


def modal_text(fit: ModalFit) -> str:
    """Write modes and delay with their standard deviations as a table.

    Parameters
    ----------
    fit : ModalFit
        The fit.

    Returns
    -------
    str
        Several lines.
    """
    response = fit.response
    unit, scale = response.shown_unit
    size = drive_text(response.amplitude, response.drive_unit)
    lines = [
        f"modes of {response.source or 'a record'}, for {size} rms about "
        f"{drive_text(response.offset, response.drive_unit)}",
        f"{'gain':>10} {unit:5} {'frequency':>10} Hz {'damping ratio':>21}",
    ]
    for k, gain in enumerate(fit.gains):
        lines.append(
            f"{scale * gain:10.4g} {'':5} {fit.frequencies[k]:10.5g} +- "
            f"{fit.frequencies_sd[k]:.1g} {fit.damping_ratios[k]:12.3g} +- "
            f"{fit.damping_ratios_sd[k]:.1g}"
        )
    if isfinite(fit.bandwidth):
        lines.append(f"bandwidth of the amplifier {fit.bandwidth:.4g} Hz")
    lines.append(f"delay {1e6 * fit.delay:.4g} +- {1e6 * fit.delay_sd:.1g} us besides the hold")
    words = f"residual: {fit.misfit:.2f} standard deviations of the response (rms)"
    if fit.misfit > APART:
        words += "; the modes do not describe all of it"
    return "\n".join([*lines, words])
