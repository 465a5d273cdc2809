"""State of a page: what a person has set in each step, as one small document."""

from __future__ import annotations

import base64
import json
import math
import zlib
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, Literal, Union, get_args, get_origin, get_type_hints

from .._support.messages import quoted
from ..errors import DataError, ParameterError
from ..export.c99.sources import checked_name

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = [
    "SHARES",
    "STEPS",
    "DeviceState",
    "LogState",
    "LoopState",
    "ModelState",
    "MotionState",
    "State",
    "UseState",
]

FORMAT = "piezotrack-state"
SCHEMA_VERSION = 1
STEPS = ("log", "model", "motion", "loop", "use")
# What has settings: the steps, and the device that several of them use.
PARTS = (*STEPS, "device")
# Characters of a text and entries of a list, at most.
LONGEST, MOST = 2000, 200

# Settings that are above 0, and those that are not below it.
ABOVE = {
    "dt",
    "resample",
    "decimate",
    "frequency",
    "steps",
    "band",
    "kp",
    "rate",
    "trials",
    "cutoff",
}
NOT_BELOW = {"seed", "ki", "kd", "low_pass", "notch", "delay", "noise", "spread"}
# Shares of the window that are fitted, at least and at most.
SHARES = (0.2, 0.9)

Span = tuple[float, float]


@dataclass(frozen=True)
class LogState:
    """Settings of the first step: the record, its columns and its window.

    Attributes
    ----------
    source : str
        Name of the file, or of a record of the package; empty without one.
    time, drive, displacement : str or None
        Titles of the columns, where they are not those that are recognised.
    units : dict of str to str
        Units of columns, where the file does not have them.
    dt : float or None
        Sampling interval, where the file has no times [s].
    missing : {"drop", "fill"} or None
        As of `piezotrack.read`.
    resample : float or None
        As of `piezotrack.read` [s].
    hold : {"zoh"} or None
        As of `piezotrack.read`; None for its default.
    decimate : int
        As of `Dataset.decimate`.
    zero : bool
        Whether displacements count from the first reading.
    window : (float, float) or None
        Part that is used [s]; None for all of it.
    """

    source: str = ""
    time: str | None = None
    drive: str | None = None
    displacement: str | None = None
    units: dict[str, str] = field(default_factory=dict)
    dt: float | None = None
    missing: Literal["drop", "fill"] | None = None
    resample: float | None = None
    hold: Literal["zoh"] | None = None
    decimate: int = 1
    zero: bool = False
    window: Span | None = None


@dataclass(frozen=True)
class ModelState:
    """Settings of the second step: the models and what they are tested with.

    Attributes
    ----------
    share : float
        Share of the window that is fitted; the rest is the test, where no second log is given.
    test : str
        Name of the second log; empty without one.
    chosen : str
        Model that the next steps use; empty for the one with the least error on the test.
    test_from : float
        Time of the second log from which it is the test [s].
    history : str or None
        As of `piezotrack.identify`; None for what the record shows.
    delay, drift : bool or None
        Whether a delay, a drift is fitted; None for what the record shows.
    seed : int
        Seed of the searches.
    """

    share: float = 0.6
    test: str = ""
    chosen: str = ""
    test_from: float = 0.0
    history: Literal["virgin", "settled", "fit"] | None = None
    delay: bool | None = None
    drift: bool | None = None
    seed: int = 0


@dataclass(frozen=True)
class MotionState:
    """Settings of the third step: the motion that is to be followed.

    Attributes
    ----------
    kind : str
        One of the kinds of `piezotrack.parse_reference`, or ``"file"``.
    frequency : float
        Frequency [Hz].
    low, high : float or None
        Lowest and highest displacement [m]; None for most of the reach.
    steps : int
        Steps of a staircase, lines of a raster.
    file : str
        Name of the file of a motion.
    band : float
        Share of a step within which it has settled.
    """

    kind: Literal["triangle", "sine", "staircase", "step", "raster", "spiral", "file"] = "triangle"
    frequency: float = 1.0
    low: float | None = None
    high: float | None = None
    steps: int = 5
    file: str = ""
    band: float = 0.02


@dataclass(frozen=True)
class LoopState:
    """Settings of the fourth step: the controller.

    Attributes
    ----------
    speed : float
        From slow, 0, to fast, 1: how little a change of the command counts beside the error.
    robustness : float
        From aggressive, 0, to robust, 1: which sensitivity is kept.
    kp, ki, kd : float or None
        Gains [V/m, V/(m s), V s/m]; None for those of the search.
    low_pass, notch : float or None
        Cut-off frequency of the low-pass and centre of the notch [Hz]; None for that of the search,
        0 for none.
    repetitive : bool
        Whether what repeats is learnt.
    delay : float
        Delay of the loop [s].
    noise : float or None
        Noise of the sensor [m]; None for that of the record.
    spread : float
        Share by which the gain of the stage may differ.
    second : bool
        Whether the stage is that of the second log, not that of the model.
    """

    speed: float = 0.5
    robustness: float = 0.5
    kp: float | None = None
    ki: float | None = None
    kd: float | None = None
    low_pass: float | None = None
    notch: float | None = None
    repetitive: bool = False
    delay: float = 0.0
    noise: float | None = None
    spread: float = 0.0
    second: bool = False


@dataclass(frozen=True)
class UseState:
    """Settings of the fifth step: the form of what is taken away.

    Attributes
    ----------
    to : str
        Form of the controller, as of `piezotrack.control.export_controller`.
    name : str
        Of its files and functions.
    single : bool
        Whether numbers in C have 4 bytes.
    width : int
        Width of pictures [mm].
    picture : str
        Format of pictures.
    """

    to: Literal["c99", "library", "json", "fmu"] = "c99"
    name: str = "controller"
    single: bool = False
    width: Literal[85, 170] = 85
    picture: Literal["pdf", "svg", "png"] = "pdf"


@dataclass(frozen=True)
class DeviceState:
    """Settings of the device that was named on the command line.

    Attributes
    ----------
    low, high : float or None
        Lowest and highest voltage [V]; None for those of the device.
    wave : str
        Drive of a record, one of `piezotrack.hardware.parse_drive`.
    frequency : float
        Its frequency [Hz].
    rate : float or None
        Sampling rate of a record [Hz]; None for 1 kHz, or the nearest that the device has.
    trials : int
        Trials of learning, at most.
    cutoff : float or None
        Highest frequency that is learnt [Hz]; None for the highest that converges.
    zero : bool
        Whether readings count from where the device rests.
    """

    low: float | None = None
    high: float | None = None
    wave: Literal["decaying", "triangle", "sine", "staircase"] = "decaying"
    frequency: float = 1.0
    rate: float | None = None
    trials: int = 10
    cutoff: float | None = None
    zero: bool = False


@dataclass(frozen=True)
class State:
    """Settings of all steps, and the step that is shown."""

    step: Literal["log", "model", "motion", "loop", "use"] = "log"
    log: LogState = field(default_factory=LogState)
    model: ModelState = field(default_factory=ModelState)
    motion: MotionState = field(default_factory=MotionState)
    loop: LoopState = field(default_factory=LoopState)
    use: UseState = field(default_factory=UseState)
    device: DeviceState = field(default_factory=DeviceState)

    def changed(self, step: str, values: Mapping[str, Any]) -> State:
        """Return the state with some settings of a step changed.

        Parameters
        ----------
        step : str
            One of the steps, or "device".
        values : mapping of str to object
            New values by name, as JSON has them.

        Returns
        -------
        State
            With the new values.

        Raises
        ------
        ParameterError
            There is no such setting, or a value is not of its kind.
        """
        if step not in PARTS:
            raise ParameterError("step", quoted(step), f"one of {', '.join(PARTS)}")
        part = getattr(self, step)
        whole: dict[str, Any] = {}
        for key, value in values.items():
            # "units.voltage" is one entry of a setting that has names.
            name, dot, entry = key.partition(".")
            if dot:
                entries = whole.get(name, getattr(part, name, {}))
                value = {**entries, entry: value or ""}
            whole[name] = value
        return replace(self, **{step: replace(part, **checked(type(part), whole))})

    def document(self) -> dict[str, Any]:
        """Content of the file of the state.

        Returns
        -------
        dict
            Of numbers, texts, lists and dicts only.
        """
        return {"format": FORMAT, "schema_version": SCHEMA_VERSION, **asdict(self)}

    def link(self) -> str:
        """Return the state as a text for an address."""
        text = json.dumps(self.document(), separators=(",", ":"))
        return base64.urlsafe_b64encode(zlib.compress(text.encode(), 9)).decode().rstrip("=")

    @classmethod
    def read(cls, content: bytes) -> State:
        """Make a state of a file's content.

        Parameters
        ----------
        content : bytes
            JSON, as `document` gives it.

        Returns
        -------
        State
            The state.

        Raises
        ------
        DataError
            It is no JSON, not a state, or of a later version.
        ParameterError
            A value is not of its kind.
        """
        try:
            found = json.loads(content)
        except (ValueError, RecursionError):
            found = None
        if not isinstance(found, dict) or found.get("format") != FORMAT:
            raise DataError(f"the file is no state of the page: expected JSON with format {FORMAT}")
        if (version := found.get("schema_version")) != SCHEMA_VERSION:
            raise DataError(
                f"schema_version of the state is {quoted(version)}: expected {SCHEMA_VERSION}"
            )
        state = cls()
        for step in PARTS:
            if not isinstance(values := found.get(step, {}), dict):
                raise ParameterError(step, quoted(values), "settings by name")
            state = state.changed(step, values)
        return replace(state, **checked(cls, {"step": found.get("step", "log")}))

    @classmethod
    def of_link(cls, text: str) -> State:
        """Make a state of the text in an address; refuses as `read` does."""
        try:
            packed = base64.urlsafe_b64decode(text + "=" * (-len(text) % 4))
            # A state is small: what unpacks to more is none.
            content = zlib.decompressobj().decompress(packed, 100_000)
        except (ValueError, zlib.error):
            content = b""
        return cls.read(content)


def checked(kind: type[Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Check values of JSON against the types of a class's fields.

    Parameters
    ----------
    kind : type
        A dataclass.
    values : mapping of str to object
        Values by the names of its fields.

    Returns
    -------
    dict
        The values, lists as tuples.

    Raises
    ------
    ParameterError
        A name is not among them, or a value is not of its type or in its range.
    """
    hints = get_type_hints(kind)
    names = [one.name for one in fields(kind) if not is_dataclass(hints[one.name])]
    taken = {}
    for name, value in values.items():
        if name not in names:
            raise ParameterError("setting", quoted(name), f"one of {', '.join(names)}")
        taken[name] = _in_range(name, _of_type(name, value, hints[name]))
    return taken


def _in_range(name: str, value: Any) -> Any:
    """Return a setting that has to be above 0, not below it, between two, or a name in C."""
    if value is not None and name in ABOVE and value <= 0:
        raise ParameterError(name, f"{value:g}", "a number above 0")
    if value is not None and name in NOT_BELOW and value < 0:
        raise ParameterError(name, f"{value:g}", "0 or a number above it")
    if name == "share" and not SHARES[0] <= value <= SHARES[1]:
        raise ParameterError(name, f"{value:g}", f"{SHARES[0]} to {SHARES[1]}")
    return checked_name(value) if name == "name" else value


def _of_type(name: str, value: Any, hint: Any) -> Any:
    """Return a value as its type has it."""
    origin, inside = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        if value is None and NoneType in inside:
            return None
        (hint,) = (one for one in inside if one is not NoneType)
        return _of_type(name, value, hint)
    if origin is Literal:
        if isinstance(value, (str, int)) and not isinstance(value, bool) and value in inside:
            return value
        raise ParameterError(name, quoted(value), f"one of {', '.join(map(str, inside))}")
    if origin is tuple and isinstance(value, (list, tuple)) and len(value) == len(inside):
        return tuple(_of_type(name, one, kind) for one, kind in zip(value, inside, strict=True))
    if origin is dict and isinstance(value, dict) and len(value) <= MOST:
        return {_of_type(name, k, str): _of_type(name, v, str) for k, v in value.items()}
    if hint is float and type(value) in (int, float) and math.isfinite(value):
        return float(value)
    if hint is str and isinstance(value, str) and len(value) <= LONGEST:
        return value
    if hint in (bool, int) and type(value) is hint:
        return value
    raise ParameterError(name, quoted(value), WORDS.get(hint, "two numbers"))


WORDS = {
    float: "a finite number",
    str: f"a text of at most {LONGEST} characters",
    bool: "true or false",
    int: "a whole number",
}
