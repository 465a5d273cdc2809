"""Observer of the hysteresis, whose estimate compensates it."""

from __future__ import annotations

from dataclasses import dataclass

from ... import _core
from ..._support.arguments import expect
from ...errors import ParameterError
from ...stages.feedback.dahl import DahlStage
from ...stages.input.bouc_wen import BoucWenStage
from ..parts.part import FeedbackLaw, part
from .pid import Pid

__all__ = ["HysteresisObserver"]


@part("hysteresis-observer")
@dataclass(frozen=True, kw_only=True)
class HysteresisObserver(FeedbackLaw):
    r"""Luenberger observer of the hysteresis around a PID.

    .. math::

        T \dot x + x = g\,(u - w), \qquad u_{FB} = u_{PID} + \hat w

    The hysteresis :math:`w`, as a voltage, is an operator of the stage: along the estimated
    displacement for a `DahlStage`, along the applied voltage for a `BoucWenStage`. Displacement and
    hysteresis are corrected by the measurement; the estimate is added on top of the PID. After
    Luenberger 1971, doi 10.1109/TAC.1971.1099826; hysteresis of Xu and Li 2010, doi
    10.1115/1.4001712. Mass, dry friction and creep of the stage are not in the observer.

    The compensation takes the place of a feedforward by the inverse of the hysteresis, which would
    compensate it twice. Give no feedforward, or a linear one: `Session.step` with ``r/g``.

    `check_loop` and `to_control` linearise the law at the largest slope that the operator has up to
    `stroke`: 0 at its smallest, where only the correction is left, which `correction` alone
    decides. Each voltage of hysteresis per voltage, slope times g, has to stay below 1.

    Parameters
    ----------
    stage : DahlStage or BoucWenStage
        The stage whose hysteresis is observed, without dry friction (`b0` 0).
    pid : Pid
        The controller inside.
    correction : float, optional
        Share L of the difference to the measurement that corrects the estimate in a sample, 0 to 1.
        With 0 the model runs beside the stage; with 1 all that the linear part does not explain is
        taken for hysteresis, noise too.
    stroke : float, optional
        Largest displacement [m] for which the largest slope of a Dahl hysteresis is computed.

    Raises
    ------
    ParameterError
        `stage` or `pid` is of another type, or a number is out of its range.

    Examples
    --------
    >>> import piezotrack as pt
    >>> stage = pt.DahlStage.xu_li_2010()
    >>> pid = pt.Pid.from_um(kp=0.02, ti=0.05)
    >>> law = pt.control.HysteresisObserver(stage=stage, pid=pid)
    >>> loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=law)
    >>> pt.check_loop(stage, loop).stable
    True
    """

    stage: DahlStage | BoucWenStage
    pid: Pid
    correction: float = 0.1
    stroke: float = 100e-6

    def __post_init__(self) -> None:
        expect("stage", self.stage, (DahlStage, BoucWenStage), "pt.DahlStage or pt.BoucWenStage")
        if isinstance(self.stage, DahlStage) and self.stage.b0 != 0.0:
            raise ParameterError(
                "stage",
                f"b0 = {self.stage.b0:g} N/m",
                "0, as dry friction is not observed",
                verb="has",
            )
        expect("pid", self.pid, Pid, "pt.Pid")
        super().__post_init__()

    @property
    def _numbers(self) -> list[float]:
        """PID, linear part, correction, stroke and operator, whose numbers are of the stage."""
        stage = self.stage
        time = stage.damping / stage.stiffness
        gain = stage.piezo_coefficient
        if isinstance(stage, DahlStage):
            static = gain / stage.stiffness
            operator = [stage.a1, stage.a2, stage.b1 * stage.up / gain]
        else:
            static = gain
            # The output in volts, h/d, has its own unit in beta and gamma.
            scale = abs(gain) ** (stage.exponent - 1.0)
            operator = [stage.alpha, stage.beta * scale, stage.gamma * scale, stage.exponent]
        shares = [_core.as_number(name, getattr(self, name)) for name in ("correction", "stroke")]
        return [*self.pid._numbers, *map(float, (static, time, *shares, *operator))]
