"""Goal of a tuning, and the budget of its search."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from ... import _core
from ..._support.arguments import as_numbers
from ..._support.messages import quoted
from ...errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["MINIMISED", "Goal", "TuningSearch"]

MINIMISED = {
    "rms": "rms error",
    "largest": "largest error",
    "effort": "rms change of the command from sample to sample",
}
ERRORS = ("measured", "true")
# Draws of the noise that each reference is followed with.
MOST_DRAWS = 100


@dataclass(frozen=True, kw_only=True)
class Goal:
    """Objective of `tune` along the references, and bounds that every controller keeps.

    Parameters
    ----------
    minimise : {"rms", "largest", "effort"}, optional
        What is made small: the rms error over all references, the largest in any, or the rms change
        of the command from sample to sample, within `largest_error`.
    tolerances : sequence of float, optional
        Error that is tolerable along each reference [m]: the rms is over the errors in shares of
        these, so that the hardest motion does not decide alone. By default all count alike.
    error : {"measured", "true"}, optional
        Whether the reading of the sensor counts or the true displacement.
    effort : float, optional
        Error that 1 V rms of change of the command from sample to sample is worth [m/V].
    slew : float, optional
        Fastest change of the command [V/s].
    largest_error : float, optional
        Largest rms error over all references [m].
    largest_saturation : float, optional
        Largest share of the samples at which the command may be clipped, as noise does where the
        reference touches the end of the stroke. From 0.5 on the references may be beyond reach.

    Raises
    ------
    ParameterError
        A word is none of those above, a value is no number, or the least effort is asked for
        without a largest error. A number that is out of its range is refused by `tune`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> calm = pt.Goal(minimise="effort", largest_error=0.3e-6)
    >>> calm.largest_saturation
    0.05
    """

    minimise: Literal["rms", "largest", "effort"] = "rms"
    tolerances: Sequence[float] = ()
    error: Literal["measured", "true"] = "measured"
    effort: float = 0.0
    slew: float = math.inf
    largest_error: float = math.inf
    largest_saturation: float = 0.05

    def __post_init__(self) -> None:
        for name, words in (("minimise", tuple(MINIMISED)), ("error", ERRORS)):
            if getattr(self, name) not in words:
                expected = ", ".join(map(repr, words))
                raise ParameterError(name, quoted(getattr(self, name)), f"one of {expected}")
        object.__setattr__(self, "tolerances", as_numbers("tolerances", self.tolerances))
        for name in ("effort", "slew", "largest_error", "largest_saturation"):
            object.__setattr__(self, name, _core.as_number(name, getattr(self, name)))
        if self.minimise == "effort" and self.largest_error == math.inf:
            raise ParameterError(
                "minimise",
                "'effort' without largest_error",
                "the largest rms error in m, for the least effort is none",
            )


@dataclass(frozen=True, kw_only=True)
class TuningSearch:
    """Budget and random draws of the search of `tune`.

    Parameters
    ----------
    particles, iterations : int, optional
        Candidates that each of the four to six searches begins with, 4 or more, and by how many
        times as many it goes on. A refinement about its best takes as many again at most.
    seed : int, optional
        Seed of the searches.
    draws : int, optional
        Draws of the sensor's noise over which each reference is followed, 1 to 100.

    Raises
    ------
    ParameterError
        A value is no whole number, or there are too many draws. A search that is too small is
        refused by `tune`.

    Examples
    --------
    >>> import piezotrack as pt
    >>> quick = pt.TuningSearch(particles=16, iterations=10)
    >>> quick.draws
    1
    """

    particles: int = 40
    iterations: int = 60
    seed: int = 1
    draws: int = 1

    def __post_init__(self) -> None:
        for name in ("particles", "iterations", "seed", "draws"):
            object.__setattr__(self, name, _core.as_count(name, getattr(self, name)))
        if not 1 <= self.draws <= MOST_DRAWS:
            raise ParameterError("draws", self.draws, f"1 to {MOST_DRAWS}")
