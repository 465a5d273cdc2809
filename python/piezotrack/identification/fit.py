"""`identify`: identification of any model, by a search or by least squares."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from ..stages.registry import model_named
from .fitted.drift import asked_drift
from .problem.checkpoint import checkpoint_of
from .problem.records import Own, asked_of, of_record
from .solve.one_model import identify_kind, refuse_given
from .solve.selection import AUTO, identify_best
from .solve.several_records import best_together, identify_together

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from ..data.dataset import Dataset
    from ..stages.model_info import ModelInfo
    from .experiments.step_response import StepResult
    from .fitted.estimates import Progress
    from .fitted.identification import Identification
    from .fitted.start import History
    from .methods.descents import Descents
    from .methods.least_squares import LeastSquares
    from .methods.particle_swarm import ParticleSwarm
    from .problem.records import Asked

    Delay = bool | float | tuple[float, float] | None
    Drift = bool | float | None

__all__ = ["identify"]


def identify(
    data: Dataset | Sequence[Dataset],
    model: str = "auto",
    *,
    free: Iterable[str] | None = None,
    fixed: Mapping[str, float] | None = None,
    initial: StepResult | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    scales: Mapping[str, Literal["linear", "log"]] | None = None,
    ties: Mapping[str, str] | None = None,
    constraints: Iterable[str] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    stiffness: float | None = None,
    offset: bool | list[bool] = True,
    delay: Delay | list[Delay] = None,
    drift: Drift | list[Drift] = None,
    history: History | list[History | None] | None = None,
    weights: Sequence[float] | None = None,
    creep: bool | Iterable[float] | None = None,
    method: Literal["descents", "swarm"] | None = None,
    swarm: ParticleSwarm | None = None,
    descents: Descents | None = None,
    least_squares: LeastSquares | None = None,
    seed: int | None = None,
    runs: int | None = None,
    threads: int | None = None,
    progress: bool | None = None,
    callback: Callable[[Progress], object] | None = None,
    checkpoint: str | os.PathLike[str] | None = None,
) -> Identification:
    r"""Identify the parameters of a stage model from a record, or from several at once.

    Minimises the RMS deviation over the record's window,

    .. math:: f = \sqrt{\tfrac{1}{n} \sum_i (x_i - \hat x_i)^2}

    (Xu and Li 2010, equation (16), doi 10.1115/1.4001712), by descents from random
    points, by a particle swarm or, where the model is linear in its weights, by least squares. The
    warm-up before the window is simulated, from rest, and not counted.

    From several records, ``pt.identify([log_a, log_b], "dahl")``, one model is identified; each
    record is simulated from a beginning of its own and has its own offset and delay. What is
    minimised is

    .. math:: f^2 = \sum_r w_r n_r f_r^2 / \sum_r w_r n_r

    with the weight, the samples and the deviation of each record: with equal weights the RMS
    deviation of all samples. Sampling intervals and holds may differ.

    Voltage and displacement determine ratios only: all parameters with the dimension of force, such
    as mass, damping and stiffness, can be multiplied by one number without changing the motion.
    Where no argument fixes a force, the stiffness is held at a nominal 1e6 N/m, and the result says
    "scale assumed". The drive of a Bouc-Wen oscillator is a force; if the record's drive is in
    volts, forces are in volts too.

    Parameters
    ----------
    data : Dataset or sequence of Dataset
        The record. ``log[3.0:23.0]`` counts this window only and keeps the drive before it as
        warm-up. Or several records, in a list, whose drives have one unit.
        `Identification.records` has what is each one's own.
    model : str, optional
        Name of the model. By default, ``"auto"``, those that suit the record are fitted to the
        first three fifths of the window and judged on the rest, and the best is fitted to all of
        it and says so: `Identification.trials`. Searched are ``"dahl"`` (`DahlStage`),
        ``"bouc-wen"`` (`BoucWenStage`), ``"first-order-dahl"`` (`FirstOrderDahlStage`),
        ``"asymmetric-bouc-wen"`` (`AsymmetricBoucWenStage`), ``"lugre"`` (`LuGreStage`),
        ``"parallel-dahl"`` (`ParallelDahlStage`) and ``"bouc-wen-oscillator"``
        (`BoucWenOscillator`); least squares find
        ``"prandtl-ishlinskii"`` (`PrandtlIshlinskiiStage`) and
        ``"generalised-prandtl-ishlinskii"`` (`GeneralisedPrandtlIshlinskiiStage`). Of the
        arguments below, `offset` and `history` apply to every model, `least_squares` to those
        found by least squares, and all others to those that are searched; an argument that
        does not apply to the model is refused.
    free : iterable of str, optional
        Parameters to search; by default all that are not fixed. `b0`, dry friction at reversals,
        is held at 0 unless it is named here or in `fixed`. Exponents are held at 1 unless they
        are in `fixed`, and so is the beta of an oscillator: the data determine only its products
        with gamma and delta.
    fixed : mapping of str to float, optional
        Parameters to hold, SI.
    initial : StepResult, optional
        Result of a step response, see `identify_step`: its a1, a2, b1 and b0 are held, as in
        section 3.3 of the paper, and b1 then fixes the scale of the forces. Those named in
        `fixed`, `free`, `bounds`, `scales`, `ties` or `priors` are not taken from it.
    bounds : mapping of str to (float, float), optional
        Bounds of free parameters, SI; derived from the record where not given. Where both are
        positive and two decades or more apart, the search is on a logarithmic scale, unless
        `scales` says otherwise.
    scales : mapping of str to {"linear", "log"}, optional
        How the search goes through the bounds of a parameter; ``"log"`` needs bounds above 0.
    ties : mapping of str to str, optional
        Parameters that follow from others, as ``{"b1": "1.57 * a2"}``: numbers, names of
        parameters, ``+ - * / **``, brackets, ``sqrt``, ``exp`` and ``log``, SI. The text is read,
        never run. It may name other tied parameters, but not in a circle.
    constraints : iterable of str, optional
        Inequalities between two parameters that are not tied, as ``["a2 < b1"]``. The search goes
        through what they leave of the bounds; equality is included. `Identification.constraints`
        says which of them decide the result.
    priors : mapping of str to (float, float), optional
        Values known besides the record with their standard deviations, SI, as
        ``{"stiffness": (2.6e4, 1e3)}``. What is minimised is then :math:`f e^{Q / 2n}` with the sum
        Q of the squared deviations from these values over their widths: the largest posterior
        density for normal priors and n independent residuals of unknown variance. Residuals of an
        inexact model are correlated, so n counts too high, and a long record outweighs a prior
        more than it should; a smaller width makes up for it. Bounds not given are eight widths on
        either side. A prior of a parameter with the dimension of force fixes the scale of all.
    stiffness : float, optional
        K [N/m] where it is known.
    offset : bool or list of bool, optional
        Whether a constant offset of the displacement is fitted too; of several records for each
        one of its own. A list has an entry for each record.
    delay : bool, float or (float, float), or a list of these, optional
        Delay of the displacement with respect to the drive [s], as amplifiers and slow sensor
        readings cause it: none (False, the default), fitted (True), known (a number), or fitted
        between two bounds. Under one slow sine the effect of a delay is that of damping; a drive
        of several frequencies separates the two. A list has an entry for each of several records;
        each has a delay of its own in any case.
    drift : bool or float, or a list of these, optional
        Slow drift of the sensor along the record, ``d exp(-t/tau)``, its amplitude fitted: none
        (False), with a time constant that the record shows (True), or with this one [s]. A record
        whose drive turns fewer than six times shows none: a loop that is not closed would look the
        same. Where it is not given: for models found by least squares what the record shows, for
        models that are searched none. A list has an entry for each of several records; each has a
        drift of its own in any case.
    history : {"virgin", "settled", "fit"}, or a list of these or None, optional
        What the stage went through before the record, whose first sample finds it in equilibrium:
        nothing (``"virgin"``), the drive of the record once or more until the hysteresis repeats
        (``"settled"``), or a voltage that is fitted with the rest, V (``"fit"``), with the creep
        that it left. Where it is not given, what the record shows: with more freedom only where
        that lowers the cost by 2 %. A list has an entry for each of several records.
    weights : sequence of float, optional
        How much each sample of a record counts beside those of the others: only the ratios matter,
        and a weight of 2 is that record given twice. 1 each where not given.
    creep : bool or iterable of float, optional
        Creep of the stage: none (False, the default), relaxations with these time constants [s],
        three at most, or two whose time constants follow from the record (True): the drive's
        period and half of the window; of several records the shortest and the longest of these,
        and one between where they are a hundred apart. What relaxes within a period widens the
        loop, as damping and hysteresis do, and one record does not tell them apart. The weights,
        0.5 together at most and the same in all records, are the best for each candidate, by
        linear least squares, and add nothing to what is searched.
        For models found by least squares, see ``LeastSquares.creep``.
    method : {"descents", "swarm"}, optional
        What searches: descents from random points until independent ones agree, or a particle
        swarm; where not given, that whose settings are, else descents.
    swarm : ParticleSwarm, optional
        Settings of the swarm.
    descents : Descents, optional
        Settings of the descents.
    least_squares : LeastSquares, optional
        Settings of the least squares: ``pt.identification.LeastSquares``.
    seed : int, optional
        0 or above, 0 where not given. The same seed gives the same bits, for any number of
        threads. Least squares, which have no random numbers, take `seed` and `runs` too, for calls
        in a loop over models.
    runs : int, optional
        Number of independent searches, each with its own random numbers: 1 by descents, 4 by a
        swarm, where not given. Different final costs show that there are several local minima; a
        rare one is found by more descents. Swarms are simulated side by side in the processor's
        SIMD lanes. Up to a million particles in all of them.
    threads : int, optional
        Up to 256; all cores where it is 0 or not given.
    progress : bool, optional
        Whether progress is shown: a bar in a terminal or notebook, elsewhere a line on stderr
        every few seconds; where not given, the bar only.
    callback : callable, optional
        Called with a `Progress` after every iteration; a true return value, or StopIteration,
        stops the search.
    checkpoint : path-like, optional
        File in which a search keeps what it has simulated, written twice a second and at its end.
        The same call goes on from it after an interruption, however it came, and gives the same
        bits as one that was not interrupted. The file stays; it is refused for another search.

    Returns
    -------
    Identification
        The model, its parameters and how they were found.

    Raises
    ------
    ParameterError
        An argument has a value that cannot be used, or does not apply to the model.
    DataError
        The checkpoint is that of another search, or cannot be written.
        The drive or the displacement is constant in the window, or parameters of the hysteresis
        are searched and neither ever reverses; for least squares also: the displacement falls as
        the drive rises, or the window is too short.
    NumericalError
        No candidate could be simulated.
    Interrupted
        Ctrl-C or the callback stopped the search; ``.partial`` has the best result so far.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> t = np.arange(1000) / 250.0
    >>> u = 37.5 * (1 - np.cos(2 * np.pi * 0.25 * t))
    >>> y = pt.DahlStage.xu_li_2010().simulate(u, 1 / 250.0).x
    >>> fit = pt.identify(
    ...     pt.Dataset(u=u, y=y, dt=1 / 250.0),
    ...     "dahl",
    ...     fixed={"mass": 0.1828, "a1": 121.9874, "a2": 1.1773e6, "b1": 1.8485e6},
    ...     seed=1,
    ... )
    >>> print(f"K = {1e-3 * fit.model.stiffness:.1f} kN/m, {fit.nit > 0}")
    K = 26.1 kN/m, True
    """
    records = asked_of(data, Own(offset, history, delay, weights, drift))
    of_swarm: dict[str, Any] = {
        "free": free,
        "fixed": fixed,
        "initial": initial,
        "bounds": bounds,
        "scales": scales,
        "ties": ties,
        "constraints": constraints,
        "priors": priors,
        "stiffness": stiffness,
        "creep": creep,
        "method": method,
        "swarm": swarm,
        "descents": descents,
        "seed": seed,
        "runs": runs,
        "threads": threads,
        "progress": progress,
        "callback": callback,
        "checkpoint": checkpoint,
    }
    info = None if isinstance(model, str) and model == AUTO else model_named(model)
    several = len(records) > 1
    if info is not None:
        refuse_given(info, of_swarm, least_squares)
    for one in records:
        with of_record(one.label):
            asked_drift(one.drift)
    said = {**of_swarm, "model": model, "least_squares": least_squares}
    with checkpoint_of(checkpoint, records, said) as kept:
        of_swarm["checkpoint"] = kept
        if several and info is None:
            return best_together(records, of_swarm, least_squares)
        if several and info is not None:
            return identify_together(records, info, of_swarm, least_squares)
        return _alone(records[0], info, of_swarm, least_squares)


def _alone(
    one: Asked, info: ModelInfo | None, of_swarm: dict[str, Any], least_squares: object
) -> Identification:
    """Identify a stage of a kind, or of the best one, from one record."""
    if info is None:
        return identify_best(one, of_swarm=of_swarm, least_squares=least_squares)
    return identify_kind(one, info, of_swarm=of_swarm, least_squares=least_squares)
