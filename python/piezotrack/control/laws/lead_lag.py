"""Lead-lag compensator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ..._support.arguments import one_of
from ..parts.part import FeedbackLaw, part

__all__ = ["LeadLag"]


@part("lead-lag")
@dataclass(frozen=True, kw_only=True)
class LeadLag(FeedbackLaw):
    r"""Lead-lag compensator, sampled as a law in state space.

    .. math:: C(s) = K_p \frac{1 + s T_{lead}}{1 + s T_{lag}}

    Franklin, Powell and Emami-Naeini, Feedback Control of Dynamic Systems. Without an integral
    part an error remains at rest, which a feedforward makes small.

    Parameters
    ----------
    kp : float
        Static gain [V/m].
    lead : float
        Time constant of the zero [s], 0 or above.
    lag : float
        Time constant of the pole [s], 0 or above; for Tustin's rule a hundredth of a sampling
        interval or more.
    method : {"tustin", "matched"}, optional
        How it is sampled: Tustin's rule, or matched pole and zero.

    Raises
    ------
    ParameterError
        A number is out of its range.

    Examples
    --------
    >>> import piezotrack as pt
    >>> law = pt.control.LeadLag(kp=1e5, lead=0.01, lag=0.1)
    >>> pt.Controller(dt=0.001, limits=(0.0, 75.0), feedback=law)
    Controller(lead-lag, 1000 Hz, 0 to 75 V)
    """

    kp: float
    lead: float
    lag: float
    method: Literal["tustin", "matched"] = "tustin"

    def __post_init__(self) -> None:
        one_of("method", self.method, ("tustin", "matched"))
        super().__post_init__()
