"""Iterative learning control: from the record of a trial, the table of the next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..._support.arguments import check_length, expect, in_range, not_negative, one_of, positive
from ..._support.arrays import real_array
from ..._support.messages import quoted
from ..._support.statistics import sample_noise
from ...data.dataset import Dataset
from ...errors import DataError, ParameterError, ShapeError
from ...references.reference import Reference
from ..controller.controller import Controller
from .plants import learning_plants
from .rules import FrequencyRule, frequency_rule, lifted_rule

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ...identification.fitted.identified_model import IdentifiedModel
    from ..plant import Plant
    from .rules import Convergence, Rule

    Array = NDArray[np.float64]

__all__ = ["IterativeLearning", "LearningTrial", "Method"]

Method = Literal["frequency", "lifted"]
# The rms of an error that is nothing but noise, over what it should be, at most.
ABOVE_NOISE = 1.1
# Trials without a change for the better after which no more is expected, and what counts as one.
STALLED, BETTER = 4, 0.98
# Parts of a period whose means show whether records differ as a whole, and how far the mean of the
# differences is beyond what these scatter by.
BLOCKS, APART = 8, 6.0
# The rms of an error, over the smallest so far, from which something must be wrong.
GROWN = 2.0


@dataclass(frozen=True, kw_only=True)
class LearningTrial:
    """Errors of one trial; desired less measured, the mean over its records.

    Attributes
    ----------
    rms_error, max_error : float
        Rms and largest error [m].
    noise : float or None
        Rms of what does not repeat in that mean [m]; None where it is not known.
    clipped : float
        Share of the samples at which the table is at a limit.
    unsettled : float
        Mean of the last record less that of the first [m], where it is beyond the noise: the loop
        has not settled, or the sensor drifts; 0 elsewhere, and of one record.
    """

    rms_error: float
    max_error: float
    noise: float | None
    clipped: float
    unsettled: float = 0.0

    @property
    def repeatable(self) -> float:
        """Rms of the part of the error that repeats [m]: all of it where no noise is known."""
        return float(np.sqrt(max(0.0, self.rms_error**2 - (self.noise or 0.0) ** 2)))


class IterativeLearning:
    r"""Learning of the voltage for a reference, trial by trial, on your own hardware.

    Play `table`, record the displacement, call `update` with the record, play the next `table`:

    .. math:: u_{j+1} = Q (\varphi u_j + \gamma L e_j)

    with u what is added to the feedforward of the controller, e desired less measured
    displacement, L the inverse of the model (with the feedback, if there is any) and Q a low-pass
    without phase. Bristow, Tharayil and Alleyne 2006, doi 10.1109/MCS.2006.1636313.

    Parameters
    ----------
    model : Stage, VirtualStage or IdentifiedModel
        Model that L is made of, linearised at its middle gain.
    reference : Reference
        The reference.
    controller : Controller
        Sampling interval, limits and, if there are any, feedforward and feedback, which stay as
        they are while the table is played. It may have no repetitive part.
    method : {"frequency", "lifted"}, optional
        ``"frequency"``: the trial is one settled period of a reference that repeats; L is the
        inverse of the frequency response at its harmonics. ``"lifted"``: the trial is the whole
        reference, from rest; L is that of regularised least squares. Of 2000 samples at most.
    models : sequence of Stage, VirtualStage or IdentifiedModel, optional
        Further models on which learning must converge, as the fits of other records.
    delay : float, optional
        Time from a reading to the effect of its voltage [s], as of `track`.
    more_delays : sequence of float, optional
        Delays in addition [s] with which it must converge as well; default 0 and half a sample.
    mode_scales : sequence of float, optional
        Factors on the frequencies of the linear dynamics with which it must converge as well.
    gain : float, optional
        Learning gain, above 0 and below 2.
    cutoff : float, optional
        Frequency at which Q is a half [Hz]; default the highest, up to a quarter of the sampling
        rate, with which a trial leaves 0.9 at most of the distance to the final table. The default
        of ``"frequency"`` falls where most of the error of a trial is at harmonics at which it grew
        beyond the noise, as at a mode that the model lacks; learning then goes on from the best.
    forgetting_factor : float, optional
        Share of the learnt voltage that is kept from trial to trial, above 0, at most 1.
    change_weight : float, optional
        Weight of the change of the table in the least squares of ``"lifted"``, in parts of the
        squared static gain.
    noise : float, optional
        Rms of what does not repeat in a record [m]. Default: from two or more records of a trial.

    Raises
    ------
    ParameterError
        A number is out of its range; the reference does not repeat with whole samples; learning
        does not converge on one of the models, which the message names with its frequency.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> stage = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(5e-7,))
    >>> loop = pt.Controller(dt=0.01, limits=(0.0, 75.0))
    >>> reference = pt.sine(frequency=1.0, low=5e-6, high=50e-6, duration=3.0)
    >>> learner = pt.control.IterativeLearning(stage, reference, loop)
    >>> for _ in range(12):
    ...     run = stage.simulate(np.tile(learner.table, 3), 0.01, hold="zoh")
    ...     table = learner.update(run.x[-100:])
    >>> learner.trials[-1].rms_error < 1e-3 * learner.trials[0].rms_error
    True
    """

    def __init__(
        self,
        model: Plant | IdentifiedModel,
        reference: Reference,
        controller: Controller,
        *,
        method: Method = "frequency",
        models: Sequence[Plant | IdentifiedModel] = (),
        delay: float = 0.0,
        more_delays: float | Sequence[float] | None = None,
        mode_scales: float | Sequence[float] = (0.9, 1.0, 1.1),
        gain: float = 0.7,
        cutoff: float | None = None,
        forgetting_factor: float = 1.0,
        change_weight: float = 0.01,
        noise: float | None = None,
    ) -> None:
        _check_kinds(reference, controller, models)
        one_of("method", method, ("frequency", "lifted"))
        self._reference, self._controller = reference, controller
        self._method: Method = method
        self._noise = None if noise is None else not_negative("noise", noise, "m")
        if self._noise is not None:
            check_length("noise", self._noise)
        dt = controller.dt
        samples = one_trial(reference, method, dt).sample(dt)
        self._t, self._desired = samples.t, samples.x
        self._feedforward = _feedforward(controller, reference, method)
        nominal, plants = learning_plants(
            [model, *models],
            controller,
            delay=delay,
            more_delays=(0.0, 0.5 * dt) if more_delays is None else more_delays,
            mode_scales=mode_scales,
        )
        rate = 0.5 / dt
        edge = None if cutoff is None else positive("cutoff", cutoff, "Hz")
        if edge is not None and not 1e-6 * rate <= edge <= rate:
            raise ParameterError(
                "cutoff", f"{edge:g} Hz", f"{1e-6 * rate:g} to {rate:g} Hz, half the sampling rate"
            )
        step = positive("gain", gain, "parts of 1")
        if step >= 2.0:
            raise ParameterError("gain", f"{step:g}", "below 2")
        # The noise of earlier trials is in the table: gain^2 (1 + (1 - gain)^2 + ...) of it.
        self._only_noise = ABOVE_NOISE * float(np.sqrt(2.0 / (2.0 - step)))
        kept = in_range("forgetting_factor", forgetting_factor, 1.0, "parts of 1")
        if kept == 0.0:
            raise ParameterError("forgetting_factor", "0", "above 0, at most 1")
        self._rule: Rule
        self._falls = method == "frequency" and edge is None
        if method == "frequency":
            self._rule = frequency_rule(
                nominal, plants, self._t.size, gain=step, cutoff=edge, forgetting_factor=kept
            )
        else:
            self._rule = lifted_rule(
                nominal,
                plants,
                self._t.size,
                gain=step,
                cutoff=edge,
                change_weight=positive("change_weight", change_weight, "parts of 1"),
                forgetting_factor=kept,
            )
        self._trials: list[LearningTrial] = []
        self._errors: list[Array] = []
        # The trial whose error has lowered the cutoff last.
        self._grown = -1
        self._tables = [np.clip(self._feedforward, *controller.limits)]

    def __repr__(self) -> str:
        return (
            f"<IterativeLearning of {self._reference!r}, {self._method}, cutoff "
            f"{self.cutoff:.4g} Hz, {len(self._trials)} trials>"
        )

    @property
    def reference(self) -> Reference:
        """The reference."""
        return self._reference

    @property
    def controller(self) -> Controller:
        """The controller beside which the table is played."""
        return self._controller

    @property
    def method(self) -> Method:
        """``"frequency"`` or ``"lifted"``."""
        return self._method

    @property
    def t(self) -> Array:
        """Time of the samples of a trial [s], shape (n,)."""
        return self._t

    @property
    def desired(self) -> Array:
        """Reference in a trial [m], shape (n,)."""
        return self._desired

    @property
    def feedforward(self) -> Array:
        """Voltage of the controller's own feedforward [V], shape (n,); 0 where it has none."""
        return self._feedforward

    @property
    def table(self) -> Array:
        """Voltage to play in the next trial [V], shape (n,): feedforward and what was learnt."""
        return self._tables[-1].copy()

    @property
    def tables(self) -> Array:
        """Tables of the trials so far, and the next one [V], shape (trials + 1, n)."""
        return np.array(self._tables)

    @property
    def trials(self) -> tuple[LearningTrial, ...]:
        """Errors of the trials so far."""
        return tuple(self._trials)

    @property
    def best(self) -> int:
        """Place of the trial with the smallest rms error, 0 for the first."""
        if not self._trials:
            raise ParameterError("best", "read without a trial", "a trial before it, by update")
        return int(np.argmin([one.rms_error for one in self._trials]))

    @property
    def convergence(self) -> Convergence:
        """Share of the distance to the final table that remains after a trial, by model."""
        return self._rule.convergence

    @property
    def cutoff(self) -> float:
        """Frequency at which Q is a half [Hz]."""
        return self._rule.cutoff

    @property
    def cutoff_lowered(self) -> bool:
        """Whether a trial has lowered the cutoff, as the error grew at harmonics."""
        return self._grown >= 0

    @property
    def rule(self) -> Rule:
        """The update: a `FrequencyRule`, which also gives filters for firmware, or `LiftedRule`."""
        return self._rule

    @property
    def stopped(self) -> str | None:
        """Why no further trial is needed; None before.

        ``"noise"``, ``"no change"``, ``"grows"``, or ``"not settled"`` where the error falls no
        further and the records of the last trial differ as a whole.
        """
        if not self._trials:
            return None
        last, errors = self._trials[-1], [one.rms_error for one in self._trials]
        known = [one.noise**2 for one in self._trials if one.noise is not None]
        if known and last.rms_error <= self._only_noise * float(np.sqrt(np.mean(known))):
            return "noise"
        # With a lower cutoff some of what was learnt is lost.
        if last.rms_error > GROWN * min(errors[self._grown + 1 :], default=math.inf):
            return "grows"
        late = len(errors) > STALLED
        if late and min(errors[-STALLED:]) > BETTER * min(errors[:-STALLED]):
            return "not settled" if last.unsettled else "no change"
        return None

    def update(self, measured: ArrayLike | Dataset | Sequence[Dataset]) -> Array:
        """Learn from the record of a trial that played `table`.

        Parameters
        ----------
        measured : array_like, shape (n,) or (records, n), or Dataset, or sequence of Dataset
            Displacement [m] at the samples `t`: of a settled period, or of the whole trial from
            rest. Of several records of the same table the mean is taken, and they show what does
            not repeat.

        Returns
        -------
        ndarray, shape (n,)
            The next `table` [V]. It is within the limits; what was learnt is what it can have.

        Raises
        ------
        DataError
            A reading is not a finite number, or a metre or more; a record has another sampling
            interval.
        ShapeError
            The record has another length. Nothing is learnt then.
        """
        records = self._checked(measured)
        error = self._desired - records.mean(axis=0)
        low, high = self._controller.limits
        table = self._tables[-1]
        unsettled = _moved(records)
        self._trials.append(
            LearningTrial(
                rms_error=float(np.sqrt(np.mean(error**2))),
                max_error=float(np.abs(error).max()),
                noise=self._noise_of(records, level=unsettled == 0.0),
                clipped=float(np.mean((table <= low) | (table >= high))),
                unsettled=unsettled,
            )
        )
        self._errors.append(error)
        base = self._base()
        learnt = self._rule.after(self._tables[base] - self._feedforward, self._errors[base])
        self._tables.append(np.clip(self._feedforward + learnt, low, high))
        return self.table

    def _base(self) -> int:
        """Return the trial to learn from: the last, or the best where that lowers the cutoff."""
        last, best = len(self._trials) - 1, self.best
        noise, clipped = self._trials[best].noise, self._trials[last].clipped
        if last == 0 or noise is None or clipped or not self._falls:
            return last
        assert isinstance(self._rule, FrequencyRule)
        before = self._errors[0], self._errors[min(best, last - 1)]
        edge = self._rule.cutoff_below_growth(before, self._errors[last], noise)
        if edge is None:
            return last
        self._rule, self._grown = replace(self._rule, cutoff=edge), last
        return best

    def _noise_of(self, records: Array, *, level: bool) -> float | None:
        """Rms of what does not repeat in a mean of records [m], their levels aside if not level."""
        count = records.shape[0]
        if self._noise is not None:
            return self._noise / float(np.sqrt(count))
        if count < 2:
            return None
        apart = records - records.mean(axis=0)
        if not level:
            apart = apart - apart.mean(axis=1, keepdims=True)
        return float(np.sqrt(np.sum(apart**2) / ((count - 1) * records.shape[1] * count)))

    def _checked(self, measured: ArrayLike | Dataset | Sequence[Dataset]) -> Array:
        """Return readings [m] of shape (records, n)."""
        if isinstance(measured, Dataset):
            measured = [measured]
        if isinstance(measured, Sequence) and any(isinstance(one, Dataset) for one in measured):
            dt = self._controller.dt
            for record in measured:
                if not isinstance(record, Dataset):
                    raise ParameterError("measured", quoted(record), "records only", verb="has")
                if abs(record.dt - dt) > 1e-6 * dt:
                    raise DataError(
                        f"measured has a sampling interval of {record.dt:g} s: expected that of "
                        f"the controller, {dt:g} s"
                    )
            measured = [one.y for one in measured if isinstance(one, Dataset)]
        try:
            records = np.atleast_2d(real_array("measured", measured))
        except ValueError as error:
            raise ShapeError("measured", f"records: {error}", "them of one length") from None
        count = self._t.size
        if records.ndim != 2 or records.shape[1] != count or records.shape[0] < 1:
            raise ShapeError(
                "measured",
                f"the shape {records.shape}",
                f"({count},) or (records, {count}), the samples of a trial",
            )
        wrong = np.argwhere(~(np.abs(records) < 1.0))
        if wrong.size:
            row, k = wrong[0]
            raise DataError(
                f"measured is {records[row, k]:g} m at sample {k}: expected finite numbers below "
                "1 m"
            )
        return records


def _moved(records: Array) -> float:
    """Mean of the last record less that of the first [m], or 0 where that is noise.

    It has to be beyond the noise from sample to sample, and stand out of the means of parts of the
    period, which noise of low frequency moves too.
    """
    if records.shape[0] < 2:
        return 0.0
    difference = records[-1] - records[0]
    means = [float(part.mean()) for part in np.array_split(difference, BLOCKS)]
    mean = float(np.mean(difference))
    spread = float(np.std(means, ddof=1)) / float(np.sqrt(BLOCKS))
    beyond = sample_noise(difference) / float(np.sqrt(2.0))
    return mean if abs(mean) > max(beyond, APART * spread) else 0.0


def _check_kinds(
    reference: Reference, controller: Controller, models: Sequence[Plant | IdentifiedModel]
) -> None:
    for name, value, kind in (
        ("controller", controller, Controller),
        ("reference", reference, Reference),
    ):
        expect(name, value, kind, f"pt.{kind.__name__}")
    if controller.repetitive is not None:
        raise ParameterError(
            "controller", "a repetitive part, which learns too", "one without", verb="has"
        )
    expect("models", models, Sequence, "a list of models")


def one_trial(reference: Reference, method: Method, dt: float) -> Reference:
    """Return the reference of a trial: one period without the smooth start, or all of it."""
    if method == "lifted":
        return reference
    if reference.period is None:
        raise ParameterError(
            "reference",
            f"({reference.name}), which does not repeat",
            "one that does with method='frequency', or method='lifted'",
        )
    turn = reference.period / dt
    if abs(turn - round(turn)) > 1e-6 or round(turn) < 8:
        raise ParameterError(
            "dt",
            f"{dt:g} s",
            f"a whole number of samples in the period, {reference.period:g} s, and 8 or more",
        )
    return replace(reference, ramp=0.0, origin=None, duration=reference.period)


def _feedforward(controller: Controller, reference: Reference, method: Method) -> Array:
    """Feedforward of a trial [V]."""
    count = len(one_trial(reference, method, controller.dt).sample(controller.dt))
    inverse, limits = controller.feedforward, controller.limits
    if inverse is None:
        return np.zeros(count)
    if method == "lifted":
        return inverse.voltage(reference, controller.dt, limits=limits)
    return inverse.table(reference, controller.dt, limits=limits)
