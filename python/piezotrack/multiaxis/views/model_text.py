"""Text of the modes of several axes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._support.units import best_length_unit, drive_text, shown_unit

if TYPE_CHECKING:
    from ..loop.closed_loop import MultiAxisTracking
    from ..modal_model import AxesLevel, MultiAxisModel

__all__ = ["axes_tracking_text", "model_text"]

# Damping ratio from which a pole is a background of the band and no mode.
BACKGROUND = 0.3


def model_text(model: MultiAxisModel) -> str:
    """Write the modes at each level, with their standard deviations, and the static gains.

    Parameters
    ----------
    model : MultiAxisModel
        The model.

    Returns
    -------
    str
        Several lines.
    """
    levels = model.levels
    lines = [
        f"{model.sensors} sensors, {model.drives} drives, {model.states} states, at "
        f"{1.0 / model.dt:g} Hz",
        "mode " + "".join(_head(model, one) for one in levels),
    ]
    frequencies = [np.abs(np.log(one.terms.poles)) / (2 * np.pi * model.dt) for one in levels]
    damping = [-np.log(one.terms.poles).real / np.abs(np.log(one.terms.poles)) for one in levels]
    background = 0
    number = 0
    for k in range(model.states // 2):
        if max(ratios[k] for ratios in damping) > BACKGROUND:
            background += 1
            continue
        number += 1
        cells = [
            f"{f[k]:11.2f} +-{_frequency_sd(model, one, k):6.2g} {z[k]:8.4f}"
            for f, z, one in zip(frequencies, damping, levels, strict=True)
        ]
        lines.append(f"{number:4d} " + "".join(cells))
    if background:
        lines.append(f"     and {background} of damping above {BACKGROUND:g}, for what is outside")
    for one in levels:
        lines.append(
            f"{drive_text(float(f'{one.level:.3g}'), model.drive_unit)} rms: the modes leave "
            f"{100 * one.misfit:.2f} % of the response; noise and distortion explain "
            f"{100 * one.expected:.2f} %"
        )
    if model.distortion:
        shares = ", ".join(f"{100 * one.distorted:.0f}" for one in levels)
        lines.append(
            f"distortion: {2 * len(model.distortion)} numbers of "
            f"{len(model.distortion.regressors)} nonlinear functions leave {shares} % of the "
            "residual of the modes"
        )
    (above, scale), (below, divisor) = shown_unit(model.output_unit), shown_unit(model.drive_unit)
    rows = [
        "  ".join(f"{gain:8.3f}" for gain in row) for row in scale / divisor * model.static_gain()
    ]
    lines += [f"static gains [{above}/{below}], sensors by drives:", *(f"  {row}" for row in rows)]
    return "\n".join([*lines, *(f"note: {note}" for note in model.notes)])


def _head(model: MultiAxisModel, one: AxesLevel) -> str:
    title = f"{drive_text(float(f'{one.level:.3g}'), model.drive_unit)} rms"
    return f"{title + ': f [Hz]':>20} {'damping':>8}"


def _frequency_sd(model: MultiAxisModel, one: AxesLevel, k: int) -> float:
    """Return the standard deviation of an undamped frequency [Hz]."""
    logarithm = np.log(one.terms.poles[k])
    size = np.abs(logarithm)
    slope = np.array([logarithm.real * logarithm.real, logarithm.imag]) / size
    sd = np.hypot(slope[0] * one.decay_sd[k], slope[1] * one.angle_sd[k])
    return float(sd / (2.0 * np.pi * model.dt))


def axes_tracking_text(run: MultiAxisTracking) -> str:
    """Write the loop, and the errors of each axis."""
    unit, scale = best_length_unit(max(figures.max_error for figures in run.metrics))
    lines = [
        f"{run.note}",
        f"axis  max {unit}  rms {unit}  off its reference, of the largest stroke",
    ]
    for k, (figures, share) in enumerate(zip(run.metrics, run.cross_coupling, strict=True)):
        lines.append(
            f"{k:>4}  {scale * figures.max_error:>6.3f}  {scale * figures.rms_error:>6.3f}  "
            f"{100 * share:.2f} %"
        )
    return "\n".join(lines)
