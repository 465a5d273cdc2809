"""Where a record begins: the state of a stage at the first sample."""

from __future__ import annotations

import hashlib
import math
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args

import numpy as np

from ... import _core
from ..._support.arguments import as_numbers
from ..._support.files.json_text import object_of, text_of
from ..._support.line_search import least_on_line
from ..._support.messages import quoted
from ...errors import ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...data.dataset import Dataset
    from ...stages.base import Stage
    from ...stages.motion import StageState

    Array = NDArray[np.float64]

__all__ = [
    "History",
    "Rest",
    "Start",
    "begin",
    "checked_history",
    "fingerprint",
    "least_voltage",
    "same_beginning",
    "start_after",
    "start_at_jump",
    "start_entry",
    "start_of",
    "state_entry",
    "state_of",
]

History = Literal["virgin", "settled", "fit", "rest"]

# A history with more freedom has to lower the rms of the residual by this share.
GAIN = 0.02
# Where the virgin and the settled stage differ by less than this share of the residual, the record
# does not show its history.
SHOWS = 0.1
# Samples by which a beginning is known, and by which histories are compared.
KNOWN_BY, COMPARED = 16, 20_000
# Voltages tried before a record: a grid, then parts of a golden section.
GRID, SECTIONS = 17, 10


class Rest(NamedTuple):
    """Rest of a stage until the drive jumped to the first sample of a record.

    Attributes
    ----------
    voltage : float
        Voltage at which it was at rest [V].
    within : bool
        Whether the drive jumped within the interval before that sample, and not at it.
    """

    voltage: float
    within: bool = False


@dataclass(frozen=True, kw_only=True)
class Start:
    """State of a stage at the first sample of a record, and what it is due to.

    Attributes
    ----------
    history : {"virgin", "settled", "fit", "rest"}
        What the stage went through before the record: nothing, the drive of the record, a voltage
        that was fitted, or rest at a voltage until the drive jumped to its first sample.
    state : StageState
        State at the first sample: in equilibrium, where the drive jumps there before the jump, and
        after one within the interval before.
    voltage : float or None
        The voltage that was fitted, or at which the stage was at rest [V].
    record : str
        Fingerprint of the beginning of the record.
    within : bool
        Whether such a jump was within the interval before the first sample, and not at it.
    """

    history: History
    state: StageState
    voltage: float | None
    record: str
    within: bool = False

    @property
    def rest(self) -> Rest | None:
        """Rest before the drive jumped to the first sample, if it did."""
        if self.history != "rest":
            return None
        return Rest(0.0 if self.voltage is None else self.voltage, self.within)


def checked_history(history: object) -> History | None:
    """Check the name of a history.

    Parameters
    ----------
    history : object
        Argument of the caller.

    Returns
    -------
    {"virgin", "settled", "fit", "rest"} or None
        The history; None where the record is to show it.

    Raises
    ------
    ParameterError
        There is no such history.
    """
    if history is None or (isinstance(history, str) and history in get_args(History)):
        return history  # type: ignore[return-value]
    raise ParameterError(
        "history", quoted(history), "'virgin', 'settled', 'fit', or None for what the record shows"
    )


def start_entry(start: Start | None, unit: str) -> dict[str, Any] | None:
    """Entry of a start in the file of a model.

    Parameters
    ----------
    start : Start or None
        The start.
    unit : str
        Unit of the drive.

    Returns
    -------
    dict or None
        Of numbers, texts and lists only.
    """
    if start is None:
        return None
    return {
        "history": start.history,
        "voltage": {"value": start.voltage, "unit": unit},
        "state": state_entry(start.state),
        "record": start.record,
        **({"jumped_within_interval": True} if start.within else {}),
    }


def state_entry(state: StageState) -> dict[str, Any]:
    """Entry of the state of a stage in a file: numbers and lists of them, in SI units."""
    return {key: list(one) if isinstance(one, tuple) else one for key, one in asdict(state).items()}


def state_of(place: str, entry: Any, state: type[StageState]) -> StageState:
    """Read the state of a stage from a file.

    Parameters
    ----------
    place : str
        Where the entry is, for messages.
    entry : Any
        The entry.
    state : type
        State of the model.

    Returns
    -------
    StageState
        The state.

    Raises
    ------
    ParameterError
        The entry is not that of such a state.
    """
    numbers: dict[str, Any] = {
        name: tuple(as_numbers(name, value))
        if isinstance(value, list)
        else _core.as_number(name, value)
        for name, value in object_of(place, entry).items()
    }
    known = {one.name for one in fields(state)}
    if extra := set(numbers) - known:
        raise ParameterError(place, quoted(min(extra)), f"{sorted(known)}", verb="has")
    return state(**numbers)


def start_of(entry: Any, state: type[StageState]) -> Start | None:
    """Read a start from the file of a model.

    Parameters
    ----------
    entry : Any
        Its entry; None in files of older versions.
    state : type
        State of the model.

    Returns
    -------
    Start or None
        The start.

    Raises
    ------
    ParameterError
        The entry is not that of a start.
    """
    start = object_of("start", entry)
    if not start:
        return None
    begun = state_of("start: state", start["state"], state)
    history = checked_history(start["history"])
    if history is None:
        raise ParameterError("start: history", "None", "'virgin', 'settled' or 'fit'")
    volts = start["voltage"]["value"]
    return Start(
        history=history,
        state=begun,
        voltage=None if volts is None else _core.as_number("start: voltage", volts),
        record=text_of("start: record", start["record"]) or "",
        within=start.get("jumped_within_interval") is True,
    )


def fingerprint(data: Dataset) -> str:
    """Fingerprint of the beginning of a record, the same for all windows with warm-up."""
    digest = hashlib.sha256()
    for part in (data.dt, data.full.u[:KNOWN_BY], data.full.recorded[:KNOWN_BY]):
        digest.update(np.asarray(part, dtype="<f8").tobytes())
    return digest.hexdigest()


def same_beginning(start: Start | None, data: Dataset) -> bool:
    """Return whether a start is that of a record, or of another window of the same record."""
    return start is not None and start.record == fingerprint(data)


def start_of_fit(data: Dataset, history: History, state: StageState) -> Start:
    """Start of a record whose state was fitted with the rest.

    Parameters
    ----------
    data : Dataset
        The record.
    history : {"virgin", "settled", "fit", "rest"}
        What the stage went through before.
    state : StageState
        State at the first sample.

    Returns
    -------
    Start
        The start, known by the beginning of the record.
    """
    return Start(history=history, state=state, voltage=None, record=fingerprint(data))


def start_after(
    model: Stage,
    data: Dataset,
    history: History,
    voltage: float | None = None,
    *,
    creeps: bool = True,
) -> Start:
    """State of a stage at the first sample of a record after a history.

    Parameters
    ----------
    model : Stage
        The stage.
    data : Dataset
        The record.
    history : {"virgin", "settled", "fit", "rest"}
        What it went through before.
    voltage : float, optional
        The voltage that it came from, for ``"fit"`` [V].
    creeps : bool, optional
        Whether the creep of a settled stage repeats, as its hysteresis does; else it is complete.

    Returns
    -------
    Start
        In equilibrium under the first sample of the drive.
    """
    full = data.full
    before = 0.0 if voltage is None else voltage
    voltages = _core.voltages_before(full.u, data.dt, data.hold, history, before)
    state = model.equilibrium(voltages.tolist())
    if creeps and history == "settled" and len(getattr(state, "creep", ())):
        state = _repeating(model, data, state)
    return Start(history=history, state=state, voltage=voltage, record=fingerprint(data))


def start_at_jump(model: Stage, data: Dataset, rest: Rest) -> Start:
    """State at the first sample of a record to which the drive jumps.

    Parameters
    ----------
    model : Stage
        The stage.
    data : Dataset
        The record.
    rest : Rest
        Its rest before.

    Returns
    -------
    Start
        The start.
    """
    state = model.equilibrium(rest.voltage)
    if rest.within:
        drive = [rest.voltage, float(data.full.u[0])]
        state = model.simulate(drive, data.dt, hold=data.hold, initial=state).final
    return Start(
        history="rest",
        state=state,
        voltage=rest.voltage,
        record=fingerprint(data),
        within=rest.within,
    )


def _repeating(model: Any, data: Dataset, state: Any) -> StageState:
    """Set the creep to where the drive of the record, repeated without end, would take it."""
    full = data.full
    times, weights = np.array(model.creep_times), np.array(model.creep_weights)
    end = model.simulate(full.u, data.dt, hold=data.hold, initial=state).final
    begun, reached = np.array(state.creep), np.array(end.creep)
    with np.errstate(all="ignore"):
        kept = np.exp(-data.dt * len(full) / times)
        moved = (reached - kept * begun) / (1.0 - kept) - begun
    return _moved(state, weights, moved)


def _moved(state: Any, weights: Array, moved: Array) -> StageState:
    """Move the creep of a state, and the displacement with it.

    What is not finite stays: creep that is slower than the rounding of a record, or has no weight.
    """
    moved = np.where(np.isfinite(moved), moved, 0.0)
    creep = tuple((np.array(state.creep) + moved).tolist())
    found: StageState = replace(state, creep=creep, x=state.x + float(weights @ moved))
    return found


def begin(
    model: Stage,
    data: Dataset,
    history: History | None,
    residual: Callable[[Dataset, StageState], Array],
    *,
    offset: bool,
    enough: float = math.inf,
    reached: tuple[float, float] | None = None,
) -> Start:
    """State of a stage at the first sample of a record, as the record shows it.

    Parameters
    ----------
    model : Stage
        The stage.
    data : Dataset
        The record.
    history : {"virgin", "settled", "fit", "rest"} or None
        What the stage went through before; None where the record is to show it.
    residual : callable
        Measured less simulated displacement in the window of a record [m], from a state at its
        first sample.
    offset : bool
        Whether a constant part of the residual is taken off.
    enough : float, optional
        Residual [m] up to which a virgin stage explains the record where a settled one does alike;
        above it a voltage that the stage came from is fitted.
    reached : (float, float), optional
        Voltages that the stage has been at elsewhere [V], from which it may have come too.

    Returns
    -------
    Start
        The start; without more freedom than the record needs.
    """
    if history == "rest":
        return start_at_jump(model, data, Rest(0.0))
    search = _Search(model, _beginning(data), residual, offset, reached or (math.inf, -math.inf))
    if history == "fit":
        return replace(search.fitted(), record=fingerprint(data))
    if history is not None:
        return start_after(model, data, history)
    virgin, settled = (start_after(model, search.data, one) for one in ("virgin", "settled"))
    best, rms = virgin, search.rms(virgin.state)
    if not search.differ(virgin, settled, rms) and rms <= enough:
        return start_after(model, data, "virgin")
    if (other := search.rms(settled.state)) < (1.0 - GAIN) * rms:
        best, rms = settled, other
    fitted = search.fitted()
    if search.rms(fitted.state) < (1.0 - GAIN) * rms:
        best = fitted
    if best.history == "fit":
        return replace(best, record=fingerprint(data))
    return start_after(model, data, best.history)


def least_voltage(
    cost: Callable[[float], float],
    ends: tuple[float, float],
    counts: tuple[int, int] = (GRID, SECTIONS),
) -> float:
    """Search a range for the voltage of least cost: a grid, then golden sections about its best.

    Parameters
    ----------
    cost : callable
        Cost of a voltage [V].
    ends : (float, float)
        The range [V].
    counts : (int, int), optional
        Voltages of the grid, and sections.

    Returns
    -------
    float
        The voltage [V].
    """
    points, sections = counts
    return least_on_line(cost, np.linspace(*ends, points), sections, float)[0]


def _beginning(data: Dataset) -> Dataset:
    """First part of a long record, with its window."""
    if len(data) <= COMPARED:
        return data
    return data[data.t[0] : data.t[COMPARED]]


@dataclass(frozen=True)
class _Search:
    """Search for the voltage that a stage came from."""

    model: Any
    data: Dataset
    residual: Callable[[Dataset, StageState], Array]
    offset: bool
    reached: tuple[float, float]

    def rms(self, state: StageState) -> float:
        rest = self.data.counted(self.residual(self.data, state))
        return float(np.std(rest) if self.offset else np.sqrt(np.mean(rest**2)))

    def differ(self, start: Start, other: Start, rms: float) -> bool:
        """Whether two starts differ by what the record shows."""
        gap = self.residual(self.data, start.state) - self.residual(self.data, other.state)
        return float(np.std(self.data.counted(gap))) > SHOWS * rms

    def fitted(self) -> Start:
        """Start from the voltage that fits the record best."""
        low, high = float(self.data.full.u.min()), float(self.data.full.u.max())
        reach = 0.5 * (high - low)
        ends = min(low - reach, self.reached[0]), max(high + reach, self.reached[1])
        volts = least_voltage(lambda volts: self.from_voltage(volts)[1], ends)
        return self.from_voltage(volts)[0]

    def from_voltage(self, volts: float) -> tuple[Start, float]:
        """Start from a voltage, its creep where it fits best, and the rms of the residual."""
        start = start_after(self.model, self.data, "fit", float(volts))
        rest = self.data.counted(self.residual(self.data, start.state))
        weights = np.array(getattr(self.model, "creep_weights", ()))
        used = weights > 0.0
        columns = [np.ones(rest.size)] if self.offset else []
        if used.any():
            t = self.data.dt * np.arange(len(self.data.full), dtype=np.float64)
            t = self.data.counted(t[self.data.warmup :])
            with np.errstate(over="ignore"):
                columns += [np.exp(-t / time) for time in np.array(self.model.creep_times)[used]]
        if columns:
            basis = np.stack(columns, axis=1)
            weighted = np.linalg.lstsq(basis, rest, rcond=1e-10)[0]
            rest = rest - basis @ weighted
            if used.any():
                moved = np.zeros(weights.size)
                with np.errstate(over="ignore"):
                    moved[used] = weighted[-int(used.sum()) :] / weights[used]
                start = replace(start, state=_moved(start.state, weights, moved))
        return start, float(np.sqrt(np.mean(rest**2)))
