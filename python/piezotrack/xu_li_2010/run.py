"""All experiments of the paper, with one seed of the sensors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from .experiments import (
    fig_03_sensor_at_rest,
    fig_04_step_test,
    fig_06_identification,
    fig_07_model_comparison,
    fig_12_14_tracking,
    fig_15_circles,
)

if TYPE_CHECKING:
    from ..identification.comparison.compare import Comparison
    from ..identification.experiments.sensor_noise import Noise
    from ..identification.experiments.step_response import StepResult
    from ..identification.fitted.identification import Identification
    from ..stages.xy import XYStage
    from .apparatus import Apparatus
    from .experiments.fig_12_14_tracking import Runs
    from .experiments.table_2 import Table2

__all__ = ["Experiments", "run_experiments"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Experiments:
    """Results of all experiments with one seed.

    Attributes
    ----------
    noise, step, fit, judged : Noise, StepResult, Identification, Comparison
        Figs. 3, 4, 6 and 7.
    compensation, antiwindup, repetitive : dict of str to Tracking
        Figs. 12, 13 and 14.
    table : Table2
        Fig. 15 and Table 2.
    stage : XYStage
        The platform of the circles.
    """

    noise: Noise
    step: StepResult
    fit: Identification
    judged: Comparison
    compensation: Runs
    antiwindup: Runs
    repetitive: Runs
    table: Table2
    stage: XYStage

    @property
    def values(self) -> dict[str, float]:
        """Values of the observables, SI, and of the conclusions."""
        return {
            **fig_03_sensor_at_rest.observe(self.noise),
            **fig_04_step_test.observe(self.step),
            **fig_06_identification.observe(self.fit),
            **fig_07_model_comparison.observe(self.judged),
            **fig_12_14_tracking.observe(self.compensation, self.antiwindup, self.repetitive),
            **fig_15_circles.observe(self.table, self.stage),
        }

    @property
    def true_values(self) -> dict[str, float]:
        """The same from the true displacement, for closed-loop motion."""
        return {
            **fig_12_14_tracking.observe(
                self.compensation, self.antiwindup, self.repetitive, true=True
            ),
            **fig_15_circles.observe(self.table, self.stage, true=True),
        }


def run_experiments(apparatus: Apparatus, seed: int) -> Experiments:
    """Run all experiments with one seed of the sensors and of the searches.

    Parameters
    ----------
    apparatus : Apparatus
        The stage and the timing of its controller.
    seed : int
        0 or above.

    Returns
    -------
    Experiments
        The results.
    """
    apparatus = apparatus.seeded(seed)
    log = fig_06_identification.record(apparatus)
    fit = fig_06_identification.search(log, seed)
    inverse = fit.inverse()
    return Experiments(
        noise=fig_03_sensor_at_rest.at_rest(apparatus),
        step=fig_04_step_test.step_test(apparatus),
        fit=fit,
        judged=fig_07_model_comparison.judge(log, fit, seed),
        compensation=fig_12_14_tracking.compensation(apparatus, inverse),
        antiwindup=fig_12_14_tracking.antiwindup(apparatus, inverse),
        repetitive=fig_12_14_tracking.repetitive(apparatus, inverse),
        table=fig_15_circles.circles(apparatus, inverse),
        stage=apparatus.stage,
    )
