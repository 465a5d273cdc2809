"""Options of ``piezotrack identify`` that say how a model is found, as arguments of the library."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

import typer

from ...errors import ParameterError
from ...stages.model_info import LISTED
from ..options import number, number_range, pairs, refuse_without_effect

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from ...data.dataset import Dataset
    from ...identification.methods.choice import Method as OneMethod
    from ...identification.methods.choice import Search
    from ...identification.methods.least_squares import LeastSquares
    from ...identification.methods.particle_swarm import ParticleSwarm
    from ...identification.problem.parameter import Parameter
    from ...identification.problem.records import Record

__all__ = [
    "AUTO",
    "Delay",
    "Delays",
    "Drifts",
    "FitOptions",
    "Histories",
    "History",
    "Kinds",
    "KindsNamed",
    "LogFiles",
    "MethodOptions",
    "ParameterOptions",
    "Weights",
    "Windows",
    "check_each_log",
    "delay_asked",
    "drift_asked",
    "each_of",
    "of_each_log",
    "searched",
]

AUTO = "auto"

T = TypeVar("T")

KindsNamed = Annotated[
    list[str] | None,
    typer.Option(
        "--model",
        metavar="MODEL",
        autocompletion=lambda: list(LISTED),
        help=f"Model: {', '.join(LISTED)}; default auto, the best of them. Repeatable.",
    ),
]
Free = Annotated[
    str | None, typer.Option(metavar="A,B,...", help="Parameters to identify; default all.")
]
Fix = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE",
        help="Parameter to hold fixed, in SI units; default none. Repeatable.",
    ),
]
Bound = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=LOW:HIGH",
        help="Bounds of a parameter, in SI units; default from the log. Repeatable.",
    ),
]
Scales = Annotated[
    list[str] | None,
    typer.Option(
        "--scale",
        metavar="NAME=linear|log",
        help="Scale on which a parameter is searched; default what suits its bounds. Repeatable.",
    ),
]
Ties = Annotated[
    list[str] | None,
    typer.Option(
        "--tie",
        metavar="NAME=EXPRESSION",
        help="Parameter that follows from others, as b1=1.57*a2, in SI units; default none. "
        "Repeatable.",
    ),
]
Constrain = Annotated[
    list[str] | None,
    typer.Option(
        metavar="'A < B'",
        help="Inequality between two parameters, in quotes; default none. Repeatable.",
    ),
]
Priors = Annotated[
    list[str] | None,
    typer.Option(
        "--prior",
        metavar="NAME=VALUE:WIDTH",
        help="Known value of a parameter and its standard deviation, in SI units; default none. "
        "Repeatable.",
    ),
]
Delay = Annotated[
    str | None,
    typer.Option(
        metavar="fit|S|LOW:HIGH",
        help="Sensor delay: fit it, a known value in s, or bounds in s; default none.",
    ),
]
Delays = Annotated[
    list[str] | None,
    typer.Option(
        "--delay",
        metavar="fit|S|LOW:HIGH",
        help="Sensor delay: fit it, a known value in s, or bounds in s; default none. Once, or "
        "once for each of several logs.",
    ),
]
Drift = Annotated[
    str | None,
    typer.Option(
        metavar="none|fit|S",
        help="Slow drift of the sensor: none, fit it, or its time constant in s; default none for "
        "models that are searched, what the log shows for the others.",
    ),
]
Drifts = Annotated[
    list[str] | None,
    typer.Option(
        "--drift",
        metavar="none|fit|S",
        help="Slow drift of the sensor: none, fit it, or its time constant in s; default none for "
        "models that are searched, what the log shows for the others. Once, or once for each of "
        "several logs.",
    ),
]
History = Annotated[
    str | None,
    typer.Option(
        metavar="virgin|settled|fit|rest",
        help="What the stage went through before the log; default what the log shows.",
    ),
]
Histories = Annotated[
    list[str] | None,
    typer.Option(
        "--history",
        metavar="virgin|settled|fit|rest",
        help="What the stage went through before the log; default what the log shows. Once, or "
        "once for each of several logs.",
    ),
]
Windows = Annotated[
    list[str] | None,
    typer.Option(
        metavar="A:B",
        help="Seconds to use, default all; the drive before A is simulated as warm-up. Once, or "
        "once for each of several logs.",
    ),
]
Weights = Annotated[
    list[float] | None,
    typer.Option(
        help="How much a sample of a log counts beside those of the others; default 1. Once for "
        "each of several logs.",
    ),
]
LogFiles = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILE...",
        help="Log of any format, with its units; or several, of which one model is made.",
    ),
]
Creep = Annotated[
    str | None,
    typer.Option(
        metavar="none|fit|S,S,...",
        help="Creep: none, fit it, or its known time constants in s; default none for models that "
        "are searched, what the log shows for the Prandtl-Ishlinskii models.",
    ),
]
Plays = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help="Number of plays of a Prandtl-Ishlinskii model, 1 to 32; default 20, or what "
        "predicts the log better.",
    ),
]
Asymmetry = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help="Number of dead zones that make a Prandtl-Ishlinskii loop asymmetric, 0 to 8; "
        "default 2.",
    ),
]
Dynamics = Annotated[
    Literal["auto", "none", "lag", "mode"] | None,
    typer.Option(
        help="Dynamics of a Prandtl-Ishlinskii model: none, a first-order lag or a resonance "
        "(mode); default auto, what the log shows.",
    ),
]
Method = Annotated[
    Literal["descents", "swarm"] | None,
    typer.Option(
        help="What searches: descents from random points until independent ones agree, or a "
        "particle swarm; default descents.",
    ),
]
Swarm = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Swarm with these settings: xu-li-2010, spso-2011 or default, which are our own.",
    ),
]

# How a search alone is run.
RUNNING = ("seed", "runs")
# Options on the parameters of one model, and others of models that are searched.
OF_ONE_MODEL = ("free", "fix", "bound", "scale", "tie", "constrain", "prior")
OF_SEARCH = (*OF_ONE_MODEL, "stiffness", "method", "swarm")
# Options of least squares.
OF_PLAYS = ("plays", "asymmetry", "dynamics")
# The library's words for the dynamics.
DYNAMICS = {"auto": "auto", "none": None, "lag": "first", "mode": "second"}


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

    def refuse_without_effect(self, context: typer.Context) -> None:
        """Refuse options that none of the kinds has."""
        named = ", ".join(self.names)
        if not any(map(searched, self.names)):
            refuse_without_effect(
                context,
                RUNNING,
                f"with the model {named}, whose parameters follow by least squares",
            )
        if not any(map(_of_plays, self.names)):
            refuse_without_effect(
                context, OF_PLAYS, f"with the model {named}, whose parameters are searched"
            )
        if context.params["stiffness"] is not None and self.names == (AUTO,):
            refuse_without_effect(
                context, OF_PLAYS, "with --stiffness, for which a search is needed"
            )

    def refuse_of_others(self, context: typer.Context) -> None:
        """Refuse options that one of the kinds does not have."""
        for name in self.names:
            if name == AUTO:
                reason = (
                    "with --model auto: name the model whose parameters these are, as --model dahl"
                )
                refuse_without_effect(context, OF_ONE_MODEL, reason)
            elif not searched(name):
                reason = f"with the model {name}, whose parameters follow by least squares"
                refuse_without_effect(context, OF_SEARCH, reason)


def searched(name: str) -> bool:
    """Whether a kind is searched, or one of those that are tried."""
    return name == AUTO or LISTED[name].searched


def _of_plays(name: str) -> bool:
    return name == AUTO or not LISTED[name].searched


@dataclass(frozen=True, kw_only=True)
class ParameterOptions:
    """Options on the parameters of a model."""

    free: Free = None
    fix: Fix = None
    bound: Bound = None
    scale: Scales = None
    tie: Ties = None
    constrain: Constrain = None
    prior: Priors = None
    stiffness: Annotated[
        float | None, typer.Option(help="Stiffness in N/m, if known; default a nominal 1e6.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class MethodOptions:
    """Options on the structure of a model and on what searches."""

    creep: Creep = None
    plays: Plays = None
    asymmetry: Asymmetry = None
    dynamics: Dynamics = None
    method: Method = None
    swarm: Swarm = None


@dataclass(frozen=True, kw_only=True)
class FitOptions(ParameterOptions, MethodOptions):
    """Options of a fit, as they are typed; None stands for what was not given."""

    seed: int | None = None
    runs: int | None

    def check(self) -> None:
        """Parse all of them, before the first model is identified."""
        self.parameters()
        _creep(self.creep)
        _ = self._swarm, self._least_squares

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

        given: dict[str, dict[str, Any]] = {}
        for option, texts, what in (
            # Priors first: their order is that in which they are summed.
            ("--prior", self.prior, "prior"),
            ("--fix", self.fix, "value"),
            ("--bound", self.bound, "bounds"),
            ("--scale", self.scale, "scale"),
            ("--tie", self.tie, "tie"),
        ):
            for name, text in pairs(option, texts):
                given.setdefault(name, {})[what] = PARSERS[what](option, text)
        if self.stiffness is not None:
            stiffness = given.setdefault("stiffness", {})
            if "value" in stiffness and stiffness["value"] != self.stiffness:
                raise ParameterError(
                    "--stiffness",
                    f"{self.stiffness:g}",
                    "the value given for it by --fix, or only one of the two",
                )
            stiffness["value"] = self.stiffness
        for name in self._free:
            if "value" in given.setdefault(name, {}):
                raise ParameterError("--free", name, "a parameter that is not fixed as well")
            if "tie" in given[name]:
                raise ParameterError("--free", name, "a parameter that is not tied")
        return {name: Parameter(**said) for name, said in given.items()}

    @property
    def _free(self) -> list[str]:
        return [] if self.free is None else [name.strip() for name in self.free.split(",")]

    def _check_free(self, kind: str, parameters: Mapping[str, Parameter]) -> None:
        """Refuse names of no parameter, and others that are not searched and have no value."""
        infos = [one for one in LISTED[kind].parameters if not one.is_list]
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

        swarm = self._swarm
        if self.method == "descents" and swarm is not None:
            raise ParameterError("--swarm", "given with --method descents", "one of them")
        running = {"seed": self.seed, "runs": self.runs}
        given: dict[str, Any] = {
            name: value for name, value in running.items() if value is not None
        }
        if swarm is not None:
            return replace(swarm, **given)
        if self.method == "swarm":
            if kind == AUTO:
                given["iterations"] = ITERATIONS
            return ParticleSwarm(**given)
        return Descents(**given) if given or self.method else None

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

    @property
    def _swarm(self) -> ParticleSwarm | None:
        return None if self.swarm is None else _swarm_named(self.swarm)


def _swarm_named(name: str) -> ParticleSwarm:
    from ...identification.methods.particle_swarm import ParticleSwarm

    known = {
        "default": ParticleSwarm(),
        "xu-li-2010": ParticleSwarm.xu_li_2010(),
        "spso-2011": ParticleSwarm.spso_2011(),
    }
    if name not in known:
        raise ParameterError("--swarm", f"'{name}'", ", ".join(known))
    return known[name]


def _prior(option: str, text: str) -> tuple[float, float]:
    value, colon, width = text.partition(":")
    if not colon:
        raise ParameterError(option, f"'{text}'", "VALUE:WIDTH", verb="has")
    return number(option, value), number(option, width)


def _text(_option: str, text: str) -> str:
    return text


PARSERS: dict[str, Callable[[str, str], Any]] = {
    "prior": _prior,
    "value": number,
    "bounds": number_range,
    "scale": _text,
    "tie": _text,
}


def of_each_log(
    logs: Sequence[Dataset],
    *,
    offset: bool,
    delay: list[str] | None,
    drift: list[str] | None,
    history: list[str] | None,
    weight: list[float] | None,
) -> list[Record]:
    """Put with each of several logs what is said of it; one value stands for all of them."""
    from ...identification.problem.records import Record, label_of, of_record

    count = len(logs)
    given = zip(
        each_of("--delay", delay, count),
        each_of("--drift", drift, count),
        each_of("--history", history, count),
        each_of("--weight", weight, count),
        strict=True,
    )
    records = []
    for i, (log, (late, drifting, before, counts)) in enumerate(zip(logs, given, strict=True)):
        with of_record(label_of(log, i) if count > 1 else ""):
            record = Record(
                log,
                offset=offset,
                delay=delay_asked(late),
                drift=None if drifting is None else drift_asked(drifting),
                history=before,  # type: ignore[arg-type]
                weight=1.0 if counts is None else counts,
            )
        records.append(record)
    return records


def check_each_log(
    count: int,
    *,
    delay: list[str] | None,
    drift: list[str] | None,
    history: list[str] | None,
    weight: list[float] | None,
) -> None:
    """Refuse what may be said of each of several logs, before they are read."""
    for option, given in (
        ("--delay", delay),
        ("--drift", drift),
        ("--history", history),
        ("--weight", weight),
    ):
        check_count(option, given, count)
    if weight and count == 1:
        raise ParameterError("--weight", "no effect with 1 log", "it left out", verb="has")
    for text in delay or []:
        delay_asked(text)
    for text in drift or []:
        drift_asked(text)


def each_of(option: str, given: Sequence[T] | None, count: int) -> list[T | None]:
    """Return an option for each of several logs: given once for all, or once for each."""
    if given is None or len(given) in (0, 1):
        return [given[0] if given else None] * count
    check_count(option, given, count)
    return list(given)


def check_count(option: str, given: Sequence[object] | None, count: int) -> None:
    """Refuse an option that is given more than once, but not once for each of several logs."""
    if given is not None and len(given) not in (1, count):
        logs = "1 log" if count == 1 else f"{count} logs"
        raise ParameterError(
            option, f"given {len(given)} times with {logs}", "once, or once for each"
        )


def delay_asked(text: str | None) -> bool | float | tuple[float, float] | None:
    """Parse what is said of the delay of a log."""
    if text is None or text == "fit":
        return None if text is None else True
    if ":" in text:
        return number_range("--delay", text)
    return number("--delay", text, "fit, a number of seconds, or bounds as LOW:HIGH")


def drift_asked(text: str) -> bool | float:
    """Parse what is said of the drift of a log."""
    if text in ("fit", "none"):
        return text == "fit"
    return number("--drift", text, "none, fit, or a number of seconds, the time constant")


def _creep(text: str | None) -> bool | list[float] | None:
    if text is None or text in ("fit", "none"):
        return None if text is None else text == "fit"
    expected = "none, fit, or numbers of seconds, the time constants, as 0.2,2"
    return [number("--creep", part, expected) for part in text.split(",")]
