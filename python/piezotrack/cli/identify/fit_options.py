"""Options of ``piezotrack identify`` that say how a model is found, as arguments of the library."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from ...errors import ParameterError
from ..command import Argument, Option, given, group, refuse_without_effect
from ..options import number, pairs
from ..values import LOOP_TIME, TIME, Names, Ranged, numbers, parted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from ...identification.methods.choice import Method as OneMethod
    from ...identification.methods.choice import Search
    from ...identification.methods.least_squares import LeastSquares
    from ...identification.problem.parameter import Parameter
    from ...stages.model_info import ModelInfo

__all__ = [
    "AUTO",
    "FitOptions",
    "Fix",
    "Kinds",
    "LogFiles",
    "MethodOptions",
    "Models",
    "ParameterOptions",
    "RecordOptions",
    "Runs",
    "each_of",
    "searched",
]

AUTO = "auto"

T = TypeVar("T")


def listed() -> Mapping[str, ModelInfo]:
    """Return all models by name."""
    from ...stages.model_info import LISTED

    return LISTED


Models = Annotated[
    list[str] | None,
    Option(
        "Name of a model, as prandtl-ishlinskii or dahl; default auto, the best. Repeatable",
        Names(listed, "NAME", strict=False),
    ),
]
LogFiles = Annotated[
    list[Path],
    Argument("Log, or several for one model: CSV, MAT, HDF5, TDMS, NPZ and others", "FILE"),
]
Fix = Annotated[list[str] | None, Option("Known value, as stiffness=1e6", metavar="NAME=VALUE")]
Runs = Annotated[int | None, Option("Independent searches; default 1, of swarms 4")]

# How a search alone is run.
RUNNING = ("seed", "runs")
# Options on the parameters of one model, and others of models that are searched.
OF_ONE_MODEL = ("free", "bound", "scale", "tie", "constrain", "prior")
OF_SEARCH = (*OF_ONE_MODEL, "fix", "method")
# Options of least squares.
OF_PLAYS = ("plays", "asymmetry", "dynamics")
# The library's words for the dynamics.
DYNAMICS = {"auto": "auto", "none": None, "lag": "first", "mode": "second"}
HISTORIES = ("virgin", "settled", "fit", "rest")
METHODS = ("descents", "swarm", "xu-li-2010", "spso-2011")


@dataclass(frozen=True)
class Kinds:
    """The models that one call of ``piezotrack identify`` is to identify."""

    names: tuple[str, ...]

    @classmethod
    def checked(cls, given: list[str] | None) -> Kinds:
        """Check the names before the first model is identified."""
        from ...stages.registry import model_named

        names = tuple(given or [AUTO])
        for i, name in enumerate(names):
            if name != AUTO:
                model_named(name)
            if name in names[:i]:
                raise ParameterError("--model", f"{name} twice", "it once", verb="names")
        return cls(names)

    def refuse_without_effect(self) -> None:
        """Refuse options that none of the models has."""
        names = ", ".join(self.names)
        if not any(map(searched, self.names)):
            reason = f"with the model {names}, which is fitted by least squares"
            refuse_without_effect(RUNNING, reason)
        if not any(map(_of_plays, self.names)):
            reason = f"with the model {names}, which is fitted by a search"
            refuse_without_effect(OF_PLAYS, reason)
        if given("fix") and self.names == (AUTO,):
            refuse_without_effect(OF_PLAYS, "with --fix, for which a search is needed")

    def refuse_of_others(self, fixed: Iterable[str]) -> None:
        """Refuse options that one of the models does not have; `fixed` are parameters."""
        for name in self.names:
            if name == AUTO:
                reason = "with --model auto"
                expected = "the model whose parameters these are, as --model dahl"
                refuse_without_effect(OF_ONE_MODEL, reason, expected)
                # The one parameter that all models with a mass have.
                if not set(fixed) <= {"stiffness"}:
                    refuse_without_effect(("fix",), reason, expected)
            elif not searched(name):
                reason = f"with the model {name}, which is fitted by least squares"
                refuse_without_effect(OF_SEARCH, reason)


def searched(name: str) -> bool:
    """Whether a model is searched, or one of those that are tried."""
    return name == AUTO or listed()[name].searched


def _of_plays(name: str) -> bool:
    return name == AUTO or not listed()[name].searched


@group
class ParameterOptions:
    """Parameters in SI units, of a model that is searched, each option repeatable."""

    fix: Fix = None
    free: Annotated[
        str | None, Option("Parameters to identify; default all", metavar="A,B,...")
    ] = None
    bound: Annotated[
        list[str] | None, Option("Bounds; default from the log", metavar="NAME=LOW:HIGH")
    ] = None
    scale: Annotated[
        list[str] | None,
        Option("Scale of the search; default by bounds", metavar="NAME=linear|log"),
    ] = None
    tie: Annotated[
        list[str] | None, Option("Dependent parameter, as b1=1.57*a2", metavar="NAME=EXPRESSION")
    ] = None
    constrain: Annotated[
        list[str] | None, Option("Inequality of two parameters, in quotes", metavar="'A < B'")
    ] = None
    prior: Annotated[
        list[str] | None,
        Option("Known value and its standard deviation", metavar="NAME=VALUE:WIDTH"),
    ] = None


@group
class MethodOptions:
    """Structure and search."""

    creep: Annotated[
        str | None,
        Option(
            "Creep, or its time constants; default none if searched, else by the log",
            metavar="none|fit|TIME,...",
        ),
    ] = None
    plays: Annotated[
        int | None, Option("Play operators of a Prandtl-Ishlinskii model, 1 to 32; default 20")
    ] = None
    asymmetry: Annotated[
        int | None, Option("Dead-zone operators, which make its loop asymmetric, 0 to 8; default 2")
    ] = None
    dynamics: Annotated[
        Literal["auto", "none", "lag", "mode"] | None,
        Option("Its dynamics: none, a lag or a mode; default auto"),
    ] = None
    method: Annotated[
        str | None,
        Option(
            "Search: descents, or a particle swarm with own or published settings; default "
            "descents",
            Names(METHODS),
        ),
    ] = None


@group
class RecordOptions:
    """Sensor and history, once, or once for each log."""

    offset: Annotated[bool, Option("Fit a constant sensor offset; default yes")] = True
    sensor_delay: Annotated[
        list[str] | None,
        Option(
            "Delay of the sensor; default by the log",
            metavar="none|fit|TIME|LOW:HIGH",
        ),
    ] = None
    drift: Annotated[
        list[str] | None,
        Option(
            "Sensor drift, or its time constant; default by the log",
            metavar="none|fit|TIME",
        ),
    ] = None
    history: Annotated[
        list[str] | None,
        Option("State at the beginning; default by the log", Names(HISTORIES)),
    ] = None

    def check(self, count: int) -> None:
        """Parse all of them, for a number of logs, before these are read."""
        for name in ("sensor_delay", "drift", "history"):
            _check_count(f"--{name.replace('_', '-')}", getattr(self, name), count)
        for text in self.sensor_delay or []:
            delay_asked(text)
        for text in self.drift or []:
            drift_asked(text)

    def of_each(self, count: int) -> list[dict[str, Any]]:
        """Arguments of `Record` or `identify` for each of a number of logs."""
        rows = zip(
            each_of("--sensor-delay", self.sensor_delay, count),
            each_of("--drift", self.drift, count),
            each_of("--history", self.history, count),
            strict=True,
        )
        return [
            {
                "offset": self.offset,
                "delay": delay_asked(delay),
                "drift": None if drift is None else drift_asked(drift),
                "history": history,
            }
            for delay, drift, history in rows
        ]


@group
class FitOptions(ParameterOptions, MethodOptions):
    """Options of a fit, as they are typed; None stands for what was not given."""

    seed: int | None = None
    runs: int | None

    def check(self) -> None:
        """Parse all of them, before the first model is identified."""
        self.parameters()
        _creep(self.creep)
        _ = self._least_squares

    def arguments_of(self, kind: str) -> dict[str, Any]:
        """Arguments of `identify` for one of the kinds, without those of the others only."""
        parameters = self.parameters()
        if self.free is not None and kind != AUTO:
            self._check_free(kind, parameters)
        arguments = {
            "parameters": parameters,
            "constraints": self.constrain,
            # That of least squares is a setting of the method.
            "creep": _creep(self.creep) if searched(kind) else None,
            "method": self._methods(kind),
        }
        return {name: value for name, value in arguments.items() if value not in (None, {}, [])}

    def parameters(self) -> dict[str, Parameter]:
        """Return what is said of each parameter."""
        from ...identification.problem.parameter import Parameter

        said: dict[str, dict[str, Any]] = {}
        for option, texts, what in (
            # Priors first: their order is that in which they are summed.
            ("--prior", self.prior, "prior"),
            ("--fix", self.fix, "value"),
            ("--bound", self.bound, "bounds"),
            ("--scale", self.scale, "scale"),
            ("--tie", self.tie, "tie"),
        ):
            for name, text in pairs(option, texts):
                said.setdefault(name, {})[what] = PARSERS[what](option, text)
        for name in self._free:
            if "value" in said.setdefault(name, {}):
                raise ParameterError("--free", name, "a parameter that is not fixed as well")
            if "tie" in said[name]:
                raise ParameterError("--free", name, "a parameter that is not tied")
        return {name: Parameter(**of) for name, of in said.items()}

    @property
    def _free(self) -> list[str]:
        return [] if self.free is None else [name.strip() for name in self.free.split(",")]

    def _check_free(self, kind: str, parameters: Mapping[str, Parameter]) -> None:
        """Refuse names of no parameter, and others that are not searched and have no value."""
        infos = [one for one in listed()[kind].parameters if not one.is_list]
        names = [one.name for one in infos]
        for name in self._free:
            if name not in names:
                raise ParameterError("--free", f"'{name}'", f"one of {', '.join(names)}")
        for info in infos:
            said = parameters.get(info.name)
            has_value = said is not None and (said.value is not None or said.tie is not None)
            # The stiffness may be nominal.
            nominal = info.name == "stiffness" and info.carries_force
            if not (info.name in self._free or has_value or nominal or info.default is not None):
                raise ParameterError(
                    "--free",
                    ", ".join(self._free),
                    f"{info.name} as well, or a value for it by --fix",
                )

    def _methods(self, kind: str) -> list[OneMethod] | None:
        """Return what searches, and the settings of least squares, where they are given."""
        search = self._search(kind) if searched(kind) else None
        weights = self._least_squares if _of_plays(kind) else None
        return [one for one in (search, weights) if one is not None] or None

    def _search(self, kind: str) -> Search | None:
        from ...identification.methods.choice import ITERATIONS
        from ...identification.methods.descents import Descents
        from ...identification.methods.particle_swarm import ParticleSwarm

        running = {"seed": self.seed, "runs": self.runs}
        settings: dict[str, Any] = {
            name: value for name, value in running.items() if value is not None
        }
        if self.method == "xu-li-2010":
            return replace(ParticleSwarm.xu_li_2010(), **settings)
        if self.method == "spso-2011":
            return replace(ParticleSwarm.spso_2011(), **settings)
        if self.method == "swarm":
            if kind == AUTO:
                settings["iterations"] = ITERATIONS
            return ParticleSwarm(**settings)
        return Descents(**settings) if settings or self.method else None

    @property
    def _least_squares(self) -> LeastSquares | None:
        from ...identification.methods.least_squares import LeastSquares

        settings: dict[str, Any] = {}
        if self.plays is not None:
            settings["count"] = self.plays
        if self.asymmetry is not None:
            settings["dead_zones"] = self.asymmetry
        if self.dynamics is not None:
            settings["dynamics"] = DYNAMICS[self.dynamics]
        if (creep := _creep(self.creep)) is not None:
            settings["creep"] = creep
        return LeastSquares(**settings) if settings else None


def _prior(option: str, text: str) -> tuple[float, float]:
    value, colon, width = text.partition(":")
    if not colon:
        raise ParameterError(option, f"'{text}'", "VALUE:WIDTH", verb="has")
    return number(option, value), number(option, width)


def _bounds(option: str, text: str) -> tuple[float, float]:
    low, mark, high = parted(text)
    if not mark:
        raise ParameterError(option, f"'{text}'", "LOW:HIGH", verb="has")
    return number(option, low), number(option, high)


def _text(_option: str, text: str) -> str:
    return text


PARSERS: dict[str, Callable[[str, str], Any]] = {
    "prior": _prior,
    "value": number,
    "bounds": _bounds,
    "scale": _text,
    "tie": _text,
}


def each_of(option: str, given: Sequence[T] | None, count: int) -> list[T | None]:
    """Return an option for each of several logs: given once for all, or once for each."""
    if given is None or len(given) in (0, 1):
        return [given[0] if given else None] * count
    _check_count(option, given, count)
    return list(given)


def _check_count(option: str, given: Sequence[object] | None, count: int) -> None:
    """Refuse an option that is given more than once, but not once for each of several logs."""
    if given is not None and len(given) not in (1, count):
        logs = "1 log" if count == 1 else f"{count} logs"
        raise ParameterError(
            option, f"given {len(given)} times with {logs}", "once, or once for each"
        )


def delay_asked(text: str | None) -> bool | float | tuple[float, float] | None:
    """Parse the delay of a log [s]."""
    if text is None or text in ("none", "fit"):
        return None if text is None else text == "fit"
    if parted(text)[1]:
        low, high = Ranged(LOOP_TIME, "LOW:HIGH").parse("--sensor-delay", text)
        return low or 0.0, high or 0.0
    return _time("--sensor-delay", text, "none, fit, a time as 2ms, or bounds as 0:5ms")


def drift_asked(text: str) -> bool | float:
    """Parse the drift of a log: whether there is one, or its time constant [s]."""
    if text in ("fit", "none"):
        return text == "fit"
    return _time("--drift", text, "none, fit, or a time constant, as 20s")


def _creep(text: str | None) -> bool | list[float] | None:
    if text is None or text in ("fit", "none"):
        return None if text is None else text == "fit"
    try:
        return list(numbers("--creep", text, TIME))
    except ParameterError:
        expected = "none, fit, or time constants, as 200ms,2s"
        raise ParameterError("--creep", f"'{text}'", expected, verb="has") from None


def _time(option: str, text: str, expected: str) -> float:
    # A delay may be meant in ms, a time constant of drift hardly.
    quantity = LOOP_TIME if option == "--sensor-delay" else TIME
    try:
        return quantity.parse(option, text)
    except ParameterError:
        raise ParameterError(option, f"'{text}'", expected, verb="has") from None
