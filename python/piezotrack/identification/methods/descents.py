"""Settings of a search by descents."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar

from ... import _core
from ..._core import DescentSettings

__all__ = ["Descents"]


@dataclass(frozen=True, kw_only=True)
class Descents:
    """Settings of a search by descents.

    Each round draws random points in the box of the free parameters, simulates them, and descends
    from the best of them that are not beside a better one, by the method of Levenberg and
    Marquardt (Marquardt 1963, doi 10.1137/0111030) with geodesic acceleration, which follows
    valleys that bend (Transtrum and Sethna 2012, doi 10.48550/arXiv.1201.5885). Rounds follow
    each other until enough independent descents have ended at the lowest cost. Multistart with a
    reduced sample: Boender, Rinnooy Kan, Timmer and Stougie 1982, doi 10.1007/BF01581046.

    Parameters
    ----------
    samples : int, optional
        Random points of a round.
    starts : int, optional
        Descents of a round.
    agreeing : int, optional
        Descents that have to end within 0.1 % of the lowest cost, 2 or more.
    rounds : int, optional
        Largest number of rounds.
    seed : int, optional
        0 or above. The same seed gives the same bits, for any number of threads.
    runs : int, optional
        Number of independent searches, each with its own random numbers. Different final costs show
        that there are several local minima.

    Raises
    ------
    ParameterError
        A setting has a value that cannot be used.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.Descents(agreeing=3).agreeing
    3
    """

    samples: int = 32
    starts: int = 32
    agreeing: int = 2
    rounds: int = 10
    seed: int = 0
    runs: int = 1

    name: ClassVar[str] = "descents"

    def __post_init__(self) -> None:
        for field in fields(self):
            value = _core.as_count(field.name, getattr(self, field.name))
            object.__setattr__(self, field.name, value)
        # The core checks the ranges.
        _ = self._core

    @property
    def _core(self) -> DescentSettings:
        """The settings in the core."""
        return DescentSettings(**self.settings())

    def settings(self) -> dict[str, Any]:
        """Return the settings of one search, without `seed` and `runs`."""
        return {name: value for name, value in vars(self).items() if name not in ("seed", "runs")}
