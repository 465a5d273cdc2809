"""References of Figs. 12 to 14, and the rules for ranges that the paper does not state."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...references.waveforms import sine

if TYPE_CHECKING:
    from ...references.reference import Reference

__all__ = ["RULES", "SHRUNK", "fast", "shrunk", "slow"]

# Fig. 13: the limits of the amplifier [V].
SHRUNK = (6.0, 28.0)
RANGE = 110e-6

# The rule of Fig. 13 is the first one written down; docs/decisions/11-calibrated-stage.md has
# the other.
RULES = {
    "13": "0.2 Hz as in Fig. 12; the limits times the published static gain, 9.4 to 44 um. The "
    "first rule written down, restored after the calibration: with the rule in between, 8 to "
    "39 um, nothing is clipped on this stage.",
    "14": "0 to 110 um as in Fig. 12, ten periods.",
}
LOW, HIGH = 9.4e-6, 44e-6


def slow() -> Reference:
    """Fig. 12: 0.2 Hz over 110 um, four periods."""
    return sine(frequency=0.2, low=0.0, high=RANGE, duration=20.0)


def shrunk(part: float = 1.0) -> Reference:
    """Fig. 13: 0.2 Hz over a range that exceeds the shrunk limits, times `part`."""
    return sine(frequency=0.2, low=LOW, high=LOW + part * (HIGH - LOW), duration=20.0)


def fast(part: float = 1.0) -> Reference:
    """Fig. 14: 0.5 Hz over 110 um times `part`, ten periods."""
    return sine(frequency=0.5, low=0.0, high=part * RANGE, duration=20.0)
