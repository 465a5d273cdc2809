"""Parts of a controller as entries of a file: the names of their settings, with their units."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

from ... import _core
from ..._support.arguments import as_numbers
from ..._support.messages import quoted
from ...errors import ParameterError
from .disturbance_observer import DisturbanceObserver
from .filters import LowPass, Notch
from .lead_lag import LeadLag
from .perturbation_estimator import PerturbationEstimator
from .pid import Pid
from .repetitive import Lag, Repetitive, ZeroPhase
from .scheduled_pid import ScheduledPid
from .sliding_mode import SlidingMode
from .state_space import StateSpace

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

__all__ = ["KINDS", "Setting", "only", "part_entry", "part_of"]

INFINITE = "inf"


class Setting(NamedTuple):
    """A setting of a part.

    Attributes
    ----------
    name : str
        Of the argument of the class.
    unit : str
        Its unit, for a drive in volts; empty where it has none.
    form : str
        What it is: a number, a count, numbers, a truth value, a text, a part, parts.
    """

    name: str
    unit: str = ""
    form: str = "number"

    def key(self, drive: str) -> str:
        """Return the key of the entry, as kp_V_per_m."""
        unit = self.unit.replace("V", drive)
        return f"{self.name}_{unit.replace('/', '_per_')}" if unit else self.name


PID = Setting("pid", form="part")
NOMINAL = (
    Setting("plant_gain", "m/V"),
    Setting("plant_time", "s"),
    Setting("cutoff", "Hz"),
)
# Every part that is made of numbers and of other parts, by its kind in a file.
KINDS: dict[str, tuple[type, tuple[Setting, ...]]] = {
    "pid": (
        Pid,
        (Setting("kp", "V/m"), Setting("ti", "s"), Setting("td", "s"), Setting("tt", "s")),
    ),
    "state-space": (
        StateSpace,
        (
            Setting("a", form="matrix"),
            Setting("b", form="numbers"),
            Setting("c", form="numbers"),
            Setting("d", "V/m"),
            Setting("back", form="numbers"),
        ),
    ),
    "lead-lag": (
        LeadLag,
        (
            Setting("kp", "V/m"),
            Setting("lead", "s"),
            Setting("lag", "s"),
            Setting("method", form="text"),
        ),
    ),
    "sliding-mode": (
        SlidingMode,
        (
            Setting("switching", "V"),
            Setting("layer", "m"),
            Setting("ti", "s"),
            Setting("td", "s"),
            Setting("tf", "s"),
        ),
    ),
    "disturbance-observer": (DisturbanceObserver, (PID, *NOMINAL)),
    "perturbation-estimator": (
        PerturbationEstimator,
        (Setting("sliding", form="part"), *NOMINAL),
    ),
    "scheduled-pid": (
        ScheduledPid,
        (
            Setting("amplitudes", "m", "numbers"),
            Setting("rates", "Hz", "numbers"),
            Setting("gains", form="parts"),
            Setting("first", "m_and_Hz", "numbers"),
        ),
    ),
    "repetitive": (
        Repetitive,
        (
            Setting("period", "s"),
            Setting("kq", "V/m"),
            Setting("smoothing", form="part"),
            Setting("lead", "samples", "count"),
            Setting("forgetting_factor"),
            Setting("pause", form="truth"),
        ),
    ),
    "lag": (Lag, (Setting("tq", "s"), Setting("compensated", form="truth"))),
    "zero-phase": (ZeroPhase, (Setting("order", form="count"),)),
    "low-pass": (LowPass, (Setting("cutoff", "Hz"),)),
    "notch": (
        Notch,
        (Setting("frequency", "Hz"), Setting("width"), Setting("depth")),
    ),
}


def part_entry(part: object, drive: str) -> dict[str, Any]:
    """Entry of a part: its kind, and its settings with their units in their names.

    Parameters
    ----------
    part : object
        A part of a controller.
    drive : str
        Unit of the drive.

    Returns
    -------
    dict
        Of numbers, texts, lists and dicts only.
    """
    kind, (_, settings) = next(
        (kind, known) for kind, known in KINDS.items() if type(part) is known[0]
    )
    values = _values(part)
    return {"kind": kind} | {
        one.key(drive): _written(one.form, values[one.name], drive) for one in settings
    }


def _values(part: object) -> Mapping[str, Any]:
    if isinstance(part, StateSpace):
        # As the core takes them: arrays of other libraries are not kept.
        a, b, c, d, back = part._matrices
        rows = [a[i : i + len(b)] for i in range(0, len(a), len(b))]
        return {"a": rows, "b": b, "c": c, "d": d, "back": back}
    return vars(part)


def _written(form: str, value: Any, drive: str) -> Any:
    if value is None or form in ("truth", "text", "matrix"):
        return value
    match form:
        case "part":
            return part_entry(value, drive)
        case "parts":
            return [part_entry(one, drive) for one in value]
        case "numbers":
            return [float(one) for one in value]
        case "count":
            return int(value)
    number = float(value)
    return INFINITE if math.isinf(number) else number


def part_of(place: str, entry: Any, kinds: Iterable[str], drive: str) -> Any:
    """Read a part.

    Parameters
    ----------
    place : str
        Where the entry is, for messages.
    entry : object
        What the file has there; null for no part.
    kinds : iterable of str
        Those that may be there.
    drive : str
        Unit of the drive.

    Returns
    -------
    object
        The part; None for no part.

    Raises
    ------
    ParameterError
        The entry is not that of such a part; the message names key, value and what was expected.
    """
    if entry is None:
        return None
    known = list(kinds)
    kind = entry.get("kind") if isinstance(entry, dict) else None
    if kind not in known:
        found = f"kind is {quoted(kind)}" if isinstance(entry, dict) else f"it is {quoted(entry)}"
        raise ParameterError(f"{place}: {found}: expected one of {', '.join(map(repr, known))}")
    made, settings = KINDS[kind]
    keys = {one.key(drive): one for one in settings}
    only(place, entry, ["kind", *keys])
    values = {
        one.name: _read(f"{place}: {key}", one, entry[key], drive) for key, one in keys.items()
    }
    try:
        return made(**values)
    except ParameterError as error:
        raise ParameterError(f"{place}: {error}") from None


def only(place: str, entry: Mapping[str, Any], keys: Iterable[str]) -> None:
    """Refuse keys that are not known, and those that are missing.

    Parameters
    ----------
    place : str
        Where the entry is, for messages; empty for the file itself.
    entry : mapping
        What the file has there.
    keys : iterable of str
        All keys that it has to have.

    Raises
    ------
    ParameterError
        There is another, or one is not there.
    """
    known, before = list(keys), f"{place}: " if place else ""
    missing = [key for key in known if key not in entry]
    for key, value in entry.items():
        if key not in known:
            expected = ", ".join(map(repr, missing or known))
            raise ParameterError(f"{before}{quoted(key)} is {quoted(value)}: expected {expected}")
    if missing:
        raise ParameterError(f"{before}{missing[0]!r} is missing: expected all of {known}")


def _read(place: str, one: Setting, value: Any, drive: str) -> Any:
    match one.form:
        case "part":
            inside = {"pid": ("pid",), "sliding": ("sliding-mode",)}
            return part_of(place, value, inside.get(one.name, ("lag", "zero-phase")), drive)
        case "parts":
            listed = value if isinstance(value, list) else [value]
            return [part_of(f"{place}[{i}]", p, ("pid",), drive) for i, p in enumerate(listed)]
        case "numbers":
            return None if value is None else as_numbers(place, value)
        case "matrix":
            rows = value if isinstance(value, list) else [value]
            return [as_numbers(f"{place}[{i}]", row) for i, row in enumerate(rows)]
        case "count":
            return _core.as_count(place, value)
        case "truth":
            return _core.as_truth(place, value)
        case "text":
            return value
    return _number(place, value)


def _number(place: str, value: Any) -> float | None:
    """Take a number, the text "inf", or null for a default."""
    if value is None:
        return None
    if value == INFINITE:
        return math.inf
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ParameterError(f"{place} is {quoted(value)}: expected a number, or 'inf'")
    return float(value)
