"""Identification of a stage from a record, by a particle swarm in Rust."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal, overload

from .. import _core
from .._support.progress_bar import ProgressBar
from ..data import diagnostics
from ..data.dataset import Dataset
from ..errors import Interrupted, ParameterError
from ..stages.base import Response
from ..stages.dahl import DahlStage
from ..stages.registry import Kind, Searched, kind_named, kind_of
from .estimates import Estimate, Progress, Run, StopReason
from .identified import Fitted
from .least_squares import PlaysIdentification, identify_plays
from .model_file import IdentifiedModel, provenance
from .step_response import StepResult
from .swarm import ParticleSwarm

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["Identification", "identify"]

# Parameters that a record without a reversal says nothing of.
HYSTERESIS = {
    *("a1", "a2", "b1", "alpha", "beta", "gamma", "delta", "rest_stiffness", "coulomb_force"),
}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Identification(Fitted[Response], IdentifiedModel):
    """What a search found; see `IdentifiedModel` for what can be done with it.

    Attributes
    ----------
    parameters : dict of str to Estimate
        The parameters with units, bounds and standard deviations; the delay with them where it
        was fitted.
    history : ndarray, shape (nit + 1,)
        Best cost after each iteration [m].
    nit : int
        Iterations of the swarm that found the best place.
    nfev, nfail : int
        Simulations of all runs, and those among them that did not stay finite.
    npolish : int
        Simulations of the polish after that swarm; `history` is the swarm's alone.
    stop_reason : {"stalled", "iterations", "interrupted"}
        Why the search ended.
    runs : tuple of Run
        The swarms that searched apart from each other; the rest is of the best of them.
    substeps, order : int
        Steps of the integrator in each sampling interval and their order, fixed for the
        search.
    seed : int
        Seed of the random numbers.
    swarm : ParticleSwarm
        Settings of the search.
    """

    parameters: Mapping[str, Estimate]
    history: NDArray[np.float64]
    nit: int
    nfev: int
    nfail: int
    npolish: int
    stop_reason: StopReason
    runs: tuple[Run, ...]
    substeps: int
    order: int
    seed: int
    swarm: ParticleSwarm

    @property
    def fun(self) -> float:
        """The cost [m], under SciPy's name."""
        return self.cost

    @property
    def notes(self) -> list[str]:
        """What a careful reader should know before using the result."""
        held = [name for name, estimate in self.parameters.items() if not estimate.free]
        notes = self._remarks(held)
        unit = kind_of(self.model).drive_unit
        if unit == "N" and self.data.drive_unit != "N":
            notes.append(f"the drive is in {self.data.drive_unit}: forces are in it too, not in N")
        rubs = isinstance(self.model, DahlStage) and self.model.b0 != 0.0
        if rubs and not self.simulate(self.data).well_posed:
            notes.append(
                "b0 q2 falls below 0 at rest: this model has another motion under the same drive"
            )
        if len(self.runs) > 1 and self.agreeing == 1:
            notes.append("no other run ended where the best one did: try more, with runs=")
        return notes

    @property
    def agreeing(self) -> int:
        """Number of runs that ended within 0.1 % of the lowest cost.

        Costs below 0.001 % of the stroke count as equal.
        """
        near = max(1.001 * self.cost, 1e-5 * self.stroke)
        return sum(run.cost <= near for run in self.runs)

    @property
    def success(self) -> bool:
        """Whether the search ended by itself."""
        return self.stop_reason != "interrupted"

    @property
    def message(self) -> str:
        """Why the search ended, in words."""
        return {
            "stalled": f"{self.swarm.stall_iterations} iterations in a row improved the cost by "
            f"less than {self.swarm.min_improvement_um:g} um",
            "iterations": f"all {self.swarm.iterations} iterations were done",
            "interrupted": "interrupted",
        }[self.stop_reason]

    def summary(self) -> str:
        """Table of the result.

        Returns
        -------
        str
            Several lines: what the data fix first, then the parameters.
        """
        from .report import summary_text

        return summary_text(self)


@overload
def identify(
    data: Dataset,
    model: Literal["prandtl-ishlinskii"],
    *,
    offset: bool = True,
    seed: int = 0,
    runs: int = 4,
    threads: int | None = None,
    progress: bool | None = None,
) -> PlaysIdentification: ...


@overload
def identify(
    data: Dataset,
    model: Searched = "dahl",
    *,
    free: Iterable[str] | None = None,
    fixed: Mapping[str, float] | None = None,
    initial: StepResult | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    stiffness: float | None = None,
    offset: bool = True,
    delay: bool | float | tuple[float, float] = False,
    swarm: ParticleSwarm | None = None,
    seed: int = 0,
    runs: int = 4,
    threads: int | None = None,
    progress: bool | None = None,
    callback: Callable[[Progress], object] | None = None,
) -> Identification: ...


@overload
def identify(
    data: Dataset,
    model: str,
    *,
    offset: bool = True,
    seed: int = 0,
    runs: int = 4,
    threads: int | None = None,
    progress: bool | None = None,
) -> Identification | PlaysIdentification: ...


def identify(
    data: Dataset,
    model: str = "dahl",
    *,
    free: Iterable[str] | None = None,
    fixed: Mapping[str, float] | None = None,
    initial: StepResult | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    stiffness: float | None = None,
    offset: bool = True,
    delay: bool | float | tuple[float, float] = False,
    swarm: ParticleSwarm | None = None,
    seed: int = 0,
    runs: int = 4,
    threads: int | None = None,
    progress: bool | None = None,
    callback: Callable[[Progress], object] | None = None,
) -> Identification | PlaysIdentification:
    r"""Find the parameters with which a stage model follows a record best.

    Minimises the RMS deviation over the record's window,

    .. math:: f = \sqrt{\tfrac{1}{n} \sum_i (x_i - \hat x_i)^2}

    (Xu and Li 2010, equation (16), doi 10.1115/1.4001712), by a particle swarm. The warm-up
    before the window is simulated, from rest, and not counted.

    Voltage and displacement fix ratios only: mass, damping, stiffness, piezo coefficient, b1 and
    b0 of a Dahl stage, or mass, damping and stiffness of a Bouc-Wen stage, can all be multiplied
    by one number without changing the motion. Where nothing in the call fixes a force, a nominal
    stiffness of 1e6 N/m is held, and the result says "scale assumed". The drive of a Bouc-Wen
    oscillator is a force itself; of one that is given in volts, forces come out in volts too.

    Parameters
    ----------
    data : Dataset
        The record. ``log[3.0:23.0]`` counts this window only and keeps the drive before it as
        warm-up.
    model : {"dahl", "bouc-wen", "first-order-dahl", "bouc-wen-oscillator", \
             "prandtl-ishlinskii"}, optional
        The kind of stage: `DahlStage`, `BoucWenStage`, `FirstOrderDahlStage`,
        `BoucWenOscillator` or `PrandtlIshlinskiiStage`. The last is found by least squares, as
        `identify_plays` does with its defaults: nothing is searched at random, so `offset` alone
        of what follows has a meaning, and `seed`, `runs`, `threads` and `progress` make no
        difference.
    free : iterable of str, optional
        Parameters to search: all that are not fixed, where not given. `b0`, dry friction at
        reversals, is held at 0 unless it is named here or in `fixed`; exponents, and the beta of
        an oscillator, of which the data tell the products with gamma and delta only, at 1 unless
        they are in `fixed`.
    fixed : mapping of str to float, optional
        Parameters to hold, SI.
    initial : StepResult, optional
        What a step told, see `identify_step`: its a1, a2, b1 and b0 are held, as in section 3.3
        of the paper, and b1 then fixes the scale of the forces. Those named in `fixed`, `free`
        or `bounds` are not taken from it.
    bounds : mapping of str to (float, float), optional
        Bounds of free parameters, SI; derived from the record where not given. Where both are
        positive and two decades or more apart, the search is on a logarithmic scale.
    stiffness : float, optional
        K [N/m] where it is known.
    offset : bool, optional
        Whether a constant offset of the displacement is fitted with the rest.
    delay : bool, float or (float, float), optional
        Time by which the displacement is late behind the drive [s], as amplifiers and slow
        readings make it: none, fitted (True), known, or fitted between two bounds. Under one
        slow sine a delay looks like damping; a drive of several frequencies tells them apart.
    swarm : ParticleSwarm, optional
        Settings of the search.
    seed : int, optional
        0 or above. The same seed gives the same bits, for any number of threads.
    runs : int, optional
        Swarms that search apart from each other, each from its own random numbers; whether they
        end with the same cost tells whether there are more valleys. They share the lanes of the
        processor.
    threads : int, optional
        Up to 256; all cores where it is 0 or not given.
    progress : bool, optional
        Whether a progress bar is shown; where not given, in a terminal or notebook only.
    callback : callable, optional
        Called with a `Progress` after every iteration; a true return value, or StopIteration,
        stops the search.

    Returns
    -------
    Identification or PlaysIdentification
        The model, its parameters and how they were found; the latter of a Prandtl-Ishlinskii
        stage.

    Raises
    ------
    ParameterError
        An argument has a value that cannot be used, or no meaning for this kind of stage.
    DataError
        The drive or the displacement is constant in the window, or hysteresis is searched
        where neither ever turns back.
    NumericalError
        Not one guess could be simulated.
    Interrupted
        Ctrl-C or the callback stopped the search; ``.partial`` has the best so far.

    Examples
    --------
    >>> import numpy as np
    >>> import piezotrack as pt
    >>> t = np.arange(1000) / 250.0
    >>> u = 37.5 * (1 - np.cos(2 * np.pi * 0.25 * t))
    >>> y = pt.DahlStage.xu_li_2010().simulate(u, 1 / 250.0).x
    >>> fit = pt.identify(
    ...     pt.Dataset(u=u, y=y, dt=1 / 250.0),
    ...     fixed={"mass": 0.1828, "a1": 121.9874, "a2": 1.1773e6, "b1": 1.8485e6},
    ...     seed=1,
    ... )
    >>> print(f"K = {fit.model.stiffness:.0f} N/m, {fit.nit > 0}")
    K = 26065 N/m, True
    """
    if not isinstance(data, Dataset):
        raise ParameterError(f"data is {type(data).__name__}: expected a Dataset, see pt.read")
    kind = kind_named(model)
    if not kind.searched:
        _refuse_search(
            *(kind, "free", free, "fixed", fixed, "initial", initial, "bounds", bounds),
            *("stiffness", stiffness, "delay", delay, "swarm", swarm, "callback", callback),
        )
        return identify_plays(data, offset=offset)
    swarm = ParticleSwarm() if swarm is None else swarm
    if not isinstance(swarm, ParticleSwarm):
        raise ParameterError(f"swarm is {swarm!r}: expected a ParticleSwarm, as pt.ParticleSwarm()")
    if callback is not None and not callable(callback):
        raise ParameterError(f"callback is {callback!r}: expected a function, or None")
    seed = _core.as_count("seed", seed)
    offset = _core.as_truth("offset", offset)
    late = _delay(delay)
    held = _held(initial, fixed, free, bounds)
    searched = {name for name, _, _ in kind.parameters} - set(held)
    searched &= HYSTERESIS
    diagnostics.check_record(data, searches_hysteresis=bool(searched))
    full = data.full
    with ProgressBar(progress) as bar:
        found = _core.identify(
            model=kind.name,
            u=full.u,
            y=full.y,
            dt=data.dt,
            hold_name=data.hold,
            start=data.warmup,
            free=_names(free),
            fixed=list(held.items()),
            bounds=[(name, _pair(name, pair)) for name, pair in _items("bounds", bounds)],
            stiffness=None if stiffness is None else _core.as_number("stiffness", stiffness),
            offset=offset,
            delay=late,
            settings=swarm.checked(),
            seed=seed,
            runs=_core.as_count("runs", runs),
            threads=0 if threads is None else _core.as_count("threads", threads),
            callback=None if callback is None else _telling(kind, callback),
            progress=bar.update,
        )
    if found is None:
        raise Interrupted("interrupted before the first cost was computed")
    fit = _identification(kind, found, data, swarm, seed, offset)
    if not fit.success:
        raise Interrupted(
            f"interrupted after {fit.nit} iterations, best cost {fit.cost_um:.4g} um", fit
        )
    return fit


def _refuse_search(kind: Kind, *given: object) -> None:
    """Refuse what only a search of parameters by their names can use: names and values in turn."""
    for name, value in zip(given[::2], given[1::2], strict=True):
        if not (value is None or value is False or value == {}):
            raise ParameterError(
                f"{name} is {value!r}: expected none with the model {kind.name!r}, whose "
                "parameters follow by least squares"
            )


def _telling(kind: Kind, callback: Callable[[Progress], object]) -> Callable[..., bool]:
    """Call back with a `Progress` where the core has plain numbers."""
    names = [name for name, _, _ in kind.parameters]

    def tell(nit: int, most: int, nfev: int, cost: float, theta: list[float]) -> bool:
        parameters = dict(zip(names, theta, strict=False))
        return bool(callback(Progress(nit, most, nfev, 1e6 * cost, parameters, theta[-1])))

    return tell


def _names(free: object) -> list[str] | None:
    """Check that free names parameters in a list."""
    if free is None:
        return None
    if isinstance(free, str) or not isinstance(free, Iterable):
        raise ParameterError(f"free is {free!r}: expected names in a list, as ['mass']")
    return [str(name) for name in free]


def _held(initial: object, fixed: object, free: object, bounds: object) -> dict[str, float]:
    """Merge what is held: by a step, where nothing else is said of the parameter, and by name."""
    given = {name: _core.as_number(name, value) for name, value in _items("fixed", fixed)}
    if initial is None:
        return given
    if not isinstance(initial, StepResult):
        raise ParameterError(
            f"initial is {type(initial).__name__}: expected a StepResult, see pt.identify_step"
        )
    said = {*(_names(free) or []), *(name for name, _ in _items("bounds", bounds))}
    return {n: v for n, v in initial.hysteresis.items() if n not in said} | given


def _items(argument: str, mapping: object) -> list[tuple[str, Any]]:
    """Check that an argument maps names of parameters to something."""
    if mapping is None:
        return []
    if not isinstance(mapping, Mapping):
        raise ParameterError(f"{argument} is {mapping!r}: expected a mapping of names to values")
    return [(str(name), value) for name, value in mapping.items()]


def _pair(name: str, pair: object) -> tuple[float, float]:
    """Check that bounds are two numbers."""
    two = list(pair) if isinstance(pair, Iterable) and not isinstance(pair, str) else []
    if len(two) != 2:
        raise ParameterError(f"bounds of {name} are {pair!r}: expected (low, high)")
    low, high = two
    return (
        _core.as_number(f"lower bound of {name}", low),
        _core.as_number(f"upper bound of {name}", high),
    )


def _delay(delay: object) -> tuple[float, float] | None:
    """Bounds of the delay; none where the core chooses them, equal ones where it is known."""
    if isinstance(delay, bool):
        return None if delay else (0.0, 0.0)
    if isinstance(delay, Iterable) and not isinstance(delay, str):
        low, high = _pair("delay", delay)
        if low == high:
            raise ParameterError(f"bounds of delay are ({low}, {high}) s: expected the lower first")
        return low, high
    known = _core.as_number("delay", delay)
    return known, known


def _identification(
    kind: Kind, found: _core.Search, data: Dataset, swarm: ParticleSwarm, seed: int, offset: bool
) -> Identification:
    deviations = {i: (deviation, at_bound) for i, deviation, at_bound in found.sensitivities}
    parameters = {}
    for i, (name, symbol, unit) in enumerate([*kind.parameters, ("delay", "Td", "s")]):
        bounds = found.bounds[i]
        deviation, at_bound = deviations.get(i, (None, False))
        parameters[name] = Estimate(
            found.theta[i], unit, symbol, bounds is not None, bounds, deviation, at_bound
        )
    late = found.theta[-1]
    if late == 0.0 and not parameters["delay"].free:
        del parameters["delay"]
    details: dict[str, Any] = {
        "parameters": {
            name: _details(estimate) for name, estimate in parameters.items() if name != "delay"
        },
        "delay": _details(parameters["delay"]) if "delay" in parameters else {},
        "fit": {
            "cost": {"value": found.rms, "unit": "m"},
            "iterations": found.iterations,
            "simulations": sum(nfev for _, _, nfev, _ in found.runs),
            "polish_simulations": found.polish_evaluations,
            "failed_simulations": found.failures,
            "stop_reason": found.stop_reason,
            "runs": [{"cost": cost, "stop_reason": reason} for cost, _, _, reason in found.runs],
            "substeps": found.substeps,
            "order": found.order,
        },
        "provenance": provenance(data, seed=seed, swarm=asdict(swarm)),
    }
    return Identification(
        model=kind.built(found.theta[:-1]),
        delay=late,
        offset=found.offset,
        offset_fitted=offset,
        scale_assumed=found.scale_assumed,
        stroke=data.stroke,
        details=details,
        data=data,
        parameters=parameters,
        cost=found.rms,
        history=found.history,
        nit=found.iterations,
        nfev=sum(nfev for _, _, nfev, _ in found.runs),
        nfail=found.failures,
        npolish=found.polish_evaluations,
        stop_reason=found.stop_reason,
        runs=tuple(Run(*run) for run in found.runs),
        substeps=found.substeps,
        order=found.order,
        seed=seed,
        swarm=swarm,
    )


def _details(estimate: Estimate) -> dict[str, Any]:
    """Keep in the file what the search says of a parameter."""
    return {
        "free": estimate.free,
        "bounds": estimate.bounds,
        "standard_deviation": estimate.deviation,
        "at_bound": estimate.at_bound,
    }
