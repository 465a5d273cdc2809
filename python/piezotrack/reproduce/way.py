"""The paper's way from one end to the other, with one seed of the sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from . import circles, models, rest, search, step_test, tracked

if TYPE_CHECKING:
    from ..comparison import Comparison
    from ..identification import Identification
    from ..noise import Noise
    from ..step import StepResult
    from ..table_2 import Table2
    from .apparatus import Apparatus
    from .tracked import Runs

__all__ = ["Way", "go"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Way:
    """All that one seed gave.

    Attributes
    ----------
    noise, step, fit, judged : Noise, StepResult, Identification, Comparison
        Figs. 3, 4, 6 and 7.
    compensation, antiwindup, repetitive : dict of str to Tracking
        Figs. 12, 13 and 14.
    table : Table2
        Fig. 15 and Table 2.
    lag : float
        From serving x to serving y [s].
    """

    noise: Noise
    step: StepResult
    fit: Identification
    judged: Comparison
    compensation: Runs
    antiwindup: Runs
    repetitive: Runs
    table: Table2
    lag: float

    @property
    def values(self) -> dict[str, float]:
        """What it gave for each observable, SI, and for the conclusions."""
        return {
            **rest.observe(self.noise),
            **step_test.observe(self.step),
            **search.observe(self.fit),
            **models.observe(self.judged),
            **tracked.observe(self.compensation, self.antiwindup, self.repetitive),
            **circles.observe(self.table, self.lag),
        }

    @property
    def true_values(self) -> dict[str, float]:
        """The same of the true displacement, for what is followed under control."""
        return {
            **tracked.observe(self.compensation, self.antiwindup, self.repetitive, true=True),
            **circles.observe(self.table, self.lag, true=True),
        }


def go(apparatus: Apparatus, seed: int) -> Way:
    """Go the whole way with one seed, of the sensors and of the searches.

    Parameters
    ----------
    apparatus : Apparatus
        The stage and its computer.
    seed : int
        0 or above.

    Returns
    -------
    Way
        Every stage of it.
    """
    apparatus = apparatus.seeded(seed)
    log = search.record(apparatus)
    fit = search.search(log, seed)
    inverse = fit.inverse()
    return Way(
        noise=rest.at_rest(apparatus),
        step=step_test.step_test(apparatus),
        fit=fit,
        judged=models.judge(log, fit, seed),
        compensation=tracked.compensation(apparatus, inverse),
        antiwindup=tracked.antiwindup(apparatus, inverse),
        repetitive=tracked.repetitive(apparatus, inverse),
        table=circles.circles(apparatus, inverse),
        lag=apparatus.stage.lag,
    )
