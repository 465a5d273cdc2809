"""`identify`: identification of any model, by a search or by least squares."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Literal

from .._support.messages import quoted
from ..errors import ParameterError
from .confidence.estimate import with_covariance
from .methods.choice import MethodChoice
from .problem.checkpoint import checkpoint_of
from .problem.problem import AUTO, Problem
from .problem.records import records_of
from .solve.run import Run
from .solve.solution import solve

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from ..data.dataset import Dataset
    from .fitted.estimates import Progress
    from .fitted.identification import Identification
    from .fitted.start import History
    from .methods.choice import Method
    from .problem.parameter import ParameterEntry
    from .problem.records import Delay, Drift, Record

__all__ = ["identify"]


def identify(
    data: Dataset | Record | Sequence[Dataset | Record],
    model: str = AUTO,
    *,
    parameters: Mapping[str, ParameterEntry] | None = None,
    constraints: Iterable[str] | None = None,
    creep: bool | Iterable[float] | None = None,
    offset: bool = True,
    delay: Delay = None,
    drift: Drift = None,
    history: History | None = None,
    method: Literal["descents", "swarm"] | Method | Sequence[Method] | None = None,
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

    with the weight (`Record`), the samples and the deviation of each record: with equal weights the
    RMS deviation of all samples. Sampling intervals and holds may differ.

    Voltage and displacement determine ratios only: all parameters with the dimension of force, such
    as mass, damping and stiffness, can be multiplied by one number without changing the motion.
    Where no parameter fixes a force, the stiffness is held at a nominal 1e6 N/m, and the result
    says "scale assumed". The drive of a Bouc-Wen oscillator is a force; if the record's drive is in
    volts, forces are in volts too.

    With priors, what is minimised is :math:`f e^{Q / 2n}` with the sum Q of the squared deviations
    of parameters from their priors over their widths: the largest posterior density for normal
    priors and n independent residuals of unknown variance. Residuals of an inexact model are
    correlated, so n counts too high, and a long record outweighs a prior more than it should; a
    smaller width makes up for it. A prior of a parameter with the dimension of force fixes the
    scale of all.

    Parameters
    ----------
    data : Dataset, Record or sequence of these
        The record. ``log[3.0:23.0]`` counts this window only and keeps the drive before it as
        warm-up. Single readings far off and those where the sensor is at its end are left out
        (`Dataset.without_faulty_readings`), and so are missing ones
        (``pt.read(..., missing="drop")``). A drive that is fast for its sampling rate is
        interpolated where that lowers the cost by 2 % (`Identification.interpolation`). Or several
        records, in a list, whose drives have one unit. A `Record` has an offset, a delay, a
        drift, a history and a weight of its own, in place of the arguments below.
        `Identification.records` has what was found of each alone.
    model : str, optional
        Name of the model. By default, ``"auto"``, those that suit the record are fitted to the
        first three fifths of the window and judged on the rest, and the best is fitted to all of
        it, others too where it leaves more than twice the noise: `Identification.selection`.
        Searched are ``"dahl"`` (`DahlStage`),
        ``"bouc-wen"`` (`BoucWenStage`), ``"first-order-dahl"`` (`FirstOrderDahlStage`),
        ``"asymmetric-bouc-wen"`` (`AsymmetricBoucWenStage`), ``"lugre"`` (`LuGreStage`),
        ``"parallel-dahl"`` (`ParallelDahlStage`) and ``"bouc-wen-oscillator"``
        (`BoucWenOscillator`); least squares find
        ``"prandtl-ishlinskii"`` (`PrandtlIshlinskiiStage`) and
        ``"generalised-prandtl-ishlinskii"`` (`GeneralisedPrandtlIshlinskiiStage`). Of the
        arguments below, `offset`, `delay`, `drift` and `history` apply to every model,
        `parameters`, `constraints`, `creep`, `callback` and `checkpoint` to those that are
        searched; an argument that does not apply to the model is refused.
    parameters : mapping of str to entry, optional
        What is known of parameters, SI: a number, at which one is held; a pair, the bounds of its
        search; a text, by which it is tied to others, as ``"1.57 * a2"``; or a `Parameter`, which
        has a scale of its search and a prior too. All others are searched, between bounds that the
        record gives; but `b0`, dry friction at reversals, is held at 0, exponents are held at 1,
        but that of ``"bouc-wen"`` where one of up to 4.5 lowers the cost by 2 %
        (``{"exponent": 1}`` holds it), and so is the beta of an oscillator: the data determine only
        its products with gamma and delta. ``Parameter()`` searches `b0`. ``step.parameters`` of a
        step response holds a1, a2, b1 and b0, as in section 3.3 of the paper; b1 then fixes the
        scale of the forces. With ``"auto"``, the stiffness alone, held.
    constraints : iterable of str, optional
        Inequalities between two parameters that are not tied, as ``["a2 < b1"]``. The search goes
        through what they leave of the bounds; equality is included. `Identification.constraints`
        says which of them decide the result.
    creep : bool or iterable of float, optional
        Creep of the stage: none (False, the default), relaxations with these time constants [s],
        three at most, or two whose time constants follow from the record (True): the drive's
        period and half of the window; of several records the shortest and the longest of these,
        and one between where they are a hundred apart. What relaxes within a period widens the
        loop, as damping and hysteresis do, and one record does not tell them apart. The weights,
        0.5 together at most and the same in all records, are the best for each candidate, by
        linear least squares, and add nothing to what is searched.
        For models found by least squares, see ``LeastSquares.creep``.
    offset : bool, optional
        Whether a constant offset of the displacement is fitted too; of several records for each
        one of its own.
    delay : bool, float or (float, float), optional
        Delay of the displacement with respect to the drive [s], as amplifiers and slow sensor
        readings cause it: none (False), fitted (True), known (a number), or fitted between two
        bounds. Where it is not given: fitted where that lowers the cost by 5 %, of one record by
        descents where by 20 %, as less may be an error of the model; by other searches none. Under
        one slow sine the effect of a delay is that of damping; a drive of several frequencies
        separates the two. Several records have delays of their own.
    drift : bool or float, optional
        Slow drift of the sensor along the record, ``d exp(-t/tau)``, its amplitude fitted: none
        (False), with a time constant that the record shows (True), or with this one [s]. Where it
        is not given: for models found by least squares what the record shows, for descents one
        that lowers the cost by 20 %, for a swarm none. Where the drive turns fewer than six times,
        a loop that is not closed looks the same: least squares then fit none, and descents without
        a value only one that leaves nothing but noise. Several records have drifts of their own.
    history : {"virgin", "settled", "fit", "rest"}, optional
        What the stage went through before the record, whose first sample finds it in equilibrium:
        nothing (``"virgin"``), the drive of the record once or more until the hysteresis repeats
        (``"settled"``), or a voltage that is fitted with the rest, V (``"fit"``), with the creep
        that it left. Or it was at rest, at 0 V or a voltage that is found, until the drive jumped
        to its first sample within one interval (``"rest"``, of one record), which is then not
        judged. Where it is not given, what the record shows: ``"settled"`` and ``"fit"`` where each
        lowers the cost by 2 %; ``"fit"`` with weights by least squares by 4 to 20 %, the more the
        residual is above the noise.
    method : {"descents", "swarm"}, Descents, ParticleSwarm, LeastSquares or sequence, optional
        What searches: descents from random points until independent ones agree (the default), or
        a particle swarm; with settings, a seed and a number of independent runs. Of models that
        least squares find, their settings. A sequence has one that searches and `LeastSquares`, of
        which the model takes the one that it needs: for ``"auto"``, and for calls in a loop over
        models.
    threads : int, optional
        Up to 256; all cores where it is 0 or not given.
    progress : bool, optional
        Whether progress is shown: a bar in a terminal or notebook, elsewhere a line on stderr
        every few seconds; where not given, the bar only. It is in per cent of all models and parts
        of the call, with the seconds that are left at most at the pace so far.
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
    ...     parameters={"mass": 0.1828, "a1": 121.9874, "a2": 1.1773e6, "b1": 1.8485e6},
    ...     method=pt.Descents(seed=1),
    ... )
    >>> print(f"K = {1e-3 * fit.model.stiffness:.1f} kN/m, {fit.search.nit > 0}")
    K = 26.1 kN/m, True
    """
    records = records_of(data, offset=offset, delay=delay, drift=drift, history=history)
    problem = Problem.checked(model, records, parameters, constraints, creep)
    methods = MethodChoice.of(method, None if model == AUTO else problem.info)
    if model != AUTO and not problem.info.searched:
        for name, value in (("callback", callback), ("checkpoint", checkpoint)):
            if value is not None:
                raise ParameterError(
                    name,
                    quoted(value),
                    f"none with the model '{model}', whose parameters follow by least squares",
                )
    run = Run(threads=0 if threads is None else threads, progress=progress, callback=callback)
    with checkpoint_of(checkpoint, problem, methods) as kept:
        return with_covariance(solve(problem, methods, replace(run, checkpoint=kept)))
