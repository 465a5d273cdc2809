"""Options of ``piezotrack identify`` that say how a model is found, as arguments of the library."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from ..errors import ParameterError
from ..stages.model_info import LISTED
from .options import number, number_range, pairs, refuse_without_effect

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from ..identification.methods.particle_swarm import ParticleSwarm

__all__ = [
    "AUTO",
    "Asymmetry",
    "Bound",
    "Constrain",
    "Creep",
    "Delay",
    "Delays",
    "Drifts",
    "Dynamics",
    "Fix",
    "Free",
    "Histories",
    "History",
    "Kinds",
    "KindsNamed",
    "LogFiles",
    "Plays",
    "Priors",
    "Scales",
    "Swarm",
    "Ties",
    "Weights",
    "Windows",
    "each_of",
    "fit_options",
    "of_each_log",
    "searched",
]

AUTO = "auto"

KindsNamed = Annotated[
    list[str] | None,
    typer.Option(
        "--model",
        metavar="MODEL",
        autocompletion=lambda: list(LISTED),
        help=f"Kind of model: {', '.join(LISTED)}; default auto, the best of them. Repeatable.",
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
        metavar="virgin|settled|fit",
        help="What the stage went through before the log; default what the log shows.",
    ),
]
Histories = Annotated[
    list[str] | None,
    typer.Option(
        "--history",
        metavar="virgin|settled|fit",
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
# Options of least squares.
OF_PLAYS = ("plays", "asymmetry", "dynamics")
# The library's words for the dynamics.
DYNAMICS = {"auto": "auto", "none": None, "lag": "first", "mode": "second"}


@dataclass(frozen=True)
class Kinds:
    """The kinds of model that one call of ``piezotrack identify`` is to identify."""

    names: tuple[str, ...]

    @classmethod
    def checked(cls, given: list[str] | None) -> Kinds:
        """Check the names before the first model is identified."""
        from ..stages.registry import model_named

        names = tuple(given or [AUTO])
        for i, name in enumerate(names):
            if name != AUTO:
                model_named(name)
            if name in names[:i]:
                raise ParameterError(f"--model names {name} twice: expected it once")
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

    def arguments_of(self, name: str, given: Mapping[str, Any]) -> dict[str, Any]:
        """Arguments of `identify` for one of the kinds, without those of the others only."""
        arguments = {key: value for key, value in given.items() if value is not None}
        if not _of_plays(name):
            arguments.pop("least_squares", None)
        elif not searched(name):
            # Its creep is a setting of the least squares.
            arguments.pop("creep", None)
        if not searched(name) and any(map(searched, self.names)):
            for key in RUNNING:
                arguments.pop(key, None)
        return arguments


def searched(name: str) -> bool:
    """Whether a kind is searched, or one of those that are tried."""
    return name == AUTO or LISTED[name].searched


def _of_plays(name: str) -> bool:
    return name == AUTO or not LISTED[name].searched


def fit_options(
    *,
    free: str | None,
    fix: list[str] | None,
    bound: list[str] | None,
    scale: list[str] | None,
    tie: list[str] | None,
    constrain: list[str] | None,
    prior: list[str] | None,
    delay: str | None,
    creep: str | None,
    plays: int | None,
    asymmetry: int | None,
    dynamics: str | None,
    method: str | None,
    swarm: str | None,
) -> dict[str, Any]:
    """Parse the options of a fit; None stands for what was not given."""
    relaxations = _creep(creep)
    return {
        "free": None if free is None else [name.strip() for name in free.split(",")],
        "fixed": {name: number("--fix", text) for name, text in pairs("--fix", fix)} or None,
        "bounds": {name: number_range("--bound", text) for name, text in pairs("--bound", bound)}
        or None,
        "scales": dict(pairs("--scale", scale)) or None,
        "ties": dict(pairs("--tie", tie)) or None,
        "constraints": constrain or None,
        "priors": {name: _prior(text) for name, text in pairs("--prior", prior)} or None,
        "delay": _delay(delay),
        "creep": relaxations,
        "least_squares": _least_squares(plays, asymmetry, dynamics, relaxations),
        "method": method,
        "swarm": _swarm(swarm),
    }


def _least_squares(
    plays: int | None, asymmetry: int | None, dynamics: str | None, creep: bool | list[float] | None
) -> Any:
    from ..identification.methods.least_squares import LeastSquares

    settings: dict[str, Any] = {}
    if plays is not None:
        settings["count"] = plays
    if asymmetry is not None:
        settings["dead_zones"] = asymmetry
    if dynamics is not None:
        settings["dynamics"] = DYNAMICS[dynamics]
    if creep is not None:
        settings["creep"] = creep
    return LeastSquares(**settings) if settings else None


def _swarm(name: str | None) -> ParticleSwarm | None:
    from ..identification.methods.particle_swarm import ParticleSwarm

    known = {
        "default": ParticleSwarm(),
        "xu-li-2010": ParticleSwarm.xu_li_2010(),
        "spso-2011": ParticleSwarm.spso_2011(),
    }
    if name is None:
        return None
    if name not in known:
        raise ParameterError(f"--swarm is '{name}': expected {', '.join(known)}")
    return known[name]


def _prior(text: str) -> tuple[float, float]:
    value, colon, width = text.partition(":")
    if not colon:
        raise ParameterError(f"--prior has '{text}': expected VALUE:WIDTH")
    return number("--prior", value), number("--prior", width)


def of_each_log(
    delay: list[str] | None,
    drift: list[str] | None,
    history: list[str] | None,
    weight: list[float] | None,
    count: int,
) -> dict[str, Any]:
    """Parse what may be said of each of several logs; one value stands for all of them."""
    for option, given in (
        ("--delay", delay),
        ("--drift", drift),
        ("--history", history),
        ("--weight", weight),
    ):
        check_count(option, given, count)
    if weight and count == 1:
        raise ParameterError("--weight has no effect with 1 log: expected it left out")
    delays = [_delay(text) for text in delay or []]
    drifts = [drift_asked(text) for text in drift or []]
    return {
        "delay": delays if len(delays) > 1 else next(iter(delays), None),
        "drift": drifts if len(drifts) > 1 else next(iter(drifts), None),
        "history": history if history and len(history) > 1 else next(iter(history or []), None),
        "weights": None if not weight else weight * count if len(weight) == 1 else weight,
    }


def each_of(option: str, given: list[str] | None, count: int) -> list[str | None]:
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
            f"{option} is given {len(given)} times with {logs}: expected once, or once for each"
        )


def _delay(text: str | None) -> bool | float | tuple[float, float] | None:
    if text is None or text == "fit":
        return None if text is None else True
    if ":" in text:
        return number_range("--delay", text)
    return number("--delay", text, "fit, a number of seconds, or bounds as LOW:HIGH")


def drift_asked(text: str) -> bool | float:
    """Parse what is asked of the drift of a log."""
    if text in ("fit", "none"):
        return text == "fit"
    return number("--drift", text, "none, fit, or a number of seconds, the time constant")


def _creep(text: str | None) -> bool | list[float] | None:
    if text is None or text in ("fit", "none"):
        return None if text is None else text == "fit"
    expected = "none, fit, or numbers of seconds, the time constants, as 0.2,2"
    return [number("--creep", part, expected) for part in text.split(",")]
