"""References and paths as text: ``sine:0.2Hz,0..110um``, ``circle:0.1Hz,10um``."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._support.arguments import expect
from .._support.messages import quoted
from .._support.units import OTHER_UNITS, Unit, known_units, lookup
from ..errors import ParameterError
from .moves import move
from .paths import circle, lissajous, raster, spiral
from .reference import Reference, read_reference
from .waveforms import chirp, multisine, sine, staircase, triangle
from .xy_reference import HOME, XYReference, read_path

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

__all__ = ["parse_path", "parse_reference", "path_of", "reference_of"]

# Length of a periodic reference where none is given, in periods.
PERIODS = 4.0

UNITS = {"frequency": "Hz, mHz, kHz", "angle": "rad, deg", "number": "none"}
UNITS |= {quantity: known_units(quantity) for quantity in ("time", "displacement", "voltage")}
PLAIN = Unit("", "number", "")


@dataclass(frozen=True)
class Kind:
    """Text form of a kind of reference, and the meaning of its items.

    An item without keyword is identified by its quantity and by the separator of its values.
    """

    make: Callable[..., Any]
    form: str
    example: str
    items: Mapping[tuple[str, str], tuple[str, ...]]
    keywords: Mapping[str, str]
    needed: tuple[str, ...]

    @property
    def expected(self) -> str:
        return f"expected {self.form}, as in {self.example}"


RANGE: dict[tuple[str, str], tuple[str, ...]] = {
    ("displacement", ".."): ("low", "high"),
    ("time", ""): ("duration",),
}
KINDS = {
    "sine": Kind(
        sine,
        "sine:FREQUENCY,LOW..HIGH[,DURATION][,phase=ANGLE][,ramp=TIME]",
        "sine:0.2Hz,0..110um",
        {("frequency", ""): ("frequency",), **RANGE},
        {"phase": "angle", "ramp": "time"},
        ("frequency", "low", "duration"),
    ),
    "triangle": Kind(
        triangle,
        "triangle:FREQUENCY,LOW..HIGH[,DURATION][,rounding=SHARE][,ramp=TIME]",
        "triangle:1Hz,0..50um",
        {("frequency", ""): ("frequency",), **RANGE},
        {"rounding": "number", "ramp": "time"},
        ("frequency", "low", "duration"),
    ),
    "staircase": Kind(
        staircase,
        "staircase:STEPS,LOW..HIGH,dwell=TIME[,rise=TIME][,DURATION]",
        "staircase:5,0..100um,dwell=1s or staircase:levels=0/30/10um,dwell=1s",
        {("number", ""): ("steps",), **RANGE},
        {"levels": "displacement", "dwell": "time", "rise": "time"},
        ("dwell",),
    ),
    "chirp": Kind(
        chirp,
        "chirp:START..STOP,LOW..HIGH,DURATION[,ramp=TIME]",
        "chirp:0.1..5Hz,0..110um,20s",
        {("frequency", ".."): ("start_frequency", "stop_frequency"), **RANGE},
        {"ramp": "time"},
        ("start_frequency", "low", "duration"),
    ),
    "multisine": Kind(
        multisine,
        "multisine:FREQUENCY/FREQUENCY/...,LOW..HIGH,DURATION[,seed=NUMBER][,ramp=TIME]",
        "multisine:0.5/1.3/2.7Hz,0..50um,20s",
        {("frequency", "/"): ("frequencies",), ("frequency", ""): ("frequencies",), **RANGE},
        {"seed": "number", "ramp": "time"},
        ("frequencies", "low", "duration"),
    ),
}
WAY: dict[tuple[str, str], tuple[str, ...]] = {
    ("displacement", ".."): ("start", "stop"),
    ("time", ""): ("duration",),
}
KINDS["s-curve"] = Kind(
    move,
    "s-curve:FROM..TO,dwell=TIME,rise=TIME[,DURATION]",
    "s-curve:0..20um,dwell=100ms,rise=2ms",
    WAY,
    {"dwell": "time", "rise": "time"},
    ("start", "dwell", "rise"),
)
KINDS |= {
    shape: Kind(
        partial(move, shape=shape),
        f"{shape}:FREQUENCY,FROM..TO,dwell=TIME[,damping=NUMBER][,rise=TIME][,DURATION]",
        f"{shape}:160Hz,0..20um,dwell=100ms",
        {("frequency", ""): ("frequency",), **WAY},
        {"dwell": "time", "damping": "number", "rise": "time"},
        ("frequency", "start", "dwell"),
    )
    for shape in ("zv", "zvd", "ei")
}
# Arguments that take a list, and the names of missing items in messages.
LISTS = ("levels", "frequencies", "sizes", "centre")
MISSING = {"low": "range", "start": "range", "start_frequency": "frequencies"}

# Written so that each letter has one meaning: the time is linear in the length of a text.
_VALUE = re.compile(r"([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)\s*([^\W\d_]*)")
# A range written with a dash or a colon.
_RANGE = re.compile(r"\s*\d+(?:\.\d*)?\s*(?:[^\W\d_]+\s*)?[-:]\s*\d")
# Longest text: more than the longest path of a file.
MOST_LETTERS = 10_000


def parse_reference(text: str, *, duration: float | None = None) -> Reference:
    r"""Make a reference from a text, as the command line takes it.

    ============================== =========================================================
    ``sine:0.2Hz,0..110um``        frequency, lowest and highest displacement; optional
                                   duration, ``phase=90deg``, ``ramp=1s``
    ``triangle:1Hz,0..50um``       the same; optional duration, ``rounding=0.2``, ``ramp=1s``
    ``chirp:0.1..5Hz,0..50um,20s`` first and last frequency, range, duration; optional
                                   ``ramp=1s``
    ``staircase:5,0..100um``       number of steps up, range, and ``dwell=1s``; or
    ``staircase:levels=0/30/10um`` levels and ``dwell=1s``; optional ``rise=0.1s``, duration
    ``multisine:0.5/1.3Hz,0..9um`` frequencies, range, duration; optional ``seed=1``,
                                   ``ramp=1s``
    ``s-curve:0..20um``            a move, with ``dwell=0.1s`` before and after, ``rise=2ms``
    ``zv:160Hz,0..20um``           a move past a mode, ``dwell=0.1s``; also ``zvd:``, ``ei:``;
                                   optional ``damping=0.02``, ``rise=2ms``
    ``target.csv``                 a file, as `read_reference` takes it
    ============================== =========================================================

    Parameters
    ----------
    text : str
        The kind and its items. A time without keyword is the duration; of several values joined
        by ``..`` or ``/`` the unit of the last applies to those without one.
    duration : float, optional
        Length [s], where `text` has none. Without either, a sine or a triangle lasts four
        periods, a staircase and a file as long as they are, and the others need one.

    Returns
    -------
    Reference
        As `sine`, `triangle`, `staircase`, `chirp`, `multisine`, `move` or `read_reference` make
        it.

    Raises
    ------
    ParameterError
        The text cannot be parsed, or a value cannot be used. The message shows the expected
        form.
    DataError
        The file cannot be read or used.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.parse_reference("sine:0.2Hz,0..110um")
    Reference(sine 0.2 Hz, 0 to 110 um, 20 s)
    >>> pt.parse_reference("staircase:levels=0/30/10um,dwell=500ms")
    Reference(staircase of 3 levels, 0 to 30 um, 1.7 s)
    """
    reference: Reference = made_from_text("reference", text, KINDS, read_reference, duration)
    return reference


def reference_of(
    given: Reference | str | os.PathLike[str],
    *,
    duration: float | None = None,
    period: float | None = None,
) -> Reference:
    """Return a reference, or make it from a text or a file.

    Parameters
    ----------
    given : Reference, str or path-like
        A reference, a text as of `parse_reference`, or a file as of `read_reference`.
    duration : float, optional
        Length [s] of a text without one, or of a file.
    period : float, optional
        Time after which a file repeats [s].

    Returns
    -------
    Reference
        `given` itself where it is one.

    Raises
    ------
    ParameterError
        It is none of these, or `period` is given with a text; ``argument`` is ``"reference"``.
    DataError
        The file cannot be read or used.

    Examples
    --------
    >>> reference_of("triangle:1Hz,5..42um").duration
    4.0
    """
    if not isinstance(given, str | os.PathLike):
        expect("reference", given, Reference, "pt.Reference or a text, as 'sine:0.2Hz,0..110um'")
        return given
    text = os.fspath(given)
    if os.path.isfile(text):
        return read_reference(text, duration=duration, period=period)
    if period is not None:
        raise ParameterError("period", "for a reference from a file", f"none with {quoted(text)}")
    return parse_reference(text, duration=duration)


def made_from_text(
    what: str,
    text: str,
    kinds: Mapping[str, Kind],
    read: Callable[..., Any],
    duration: float | None,
    **others: Any,
) -> Any:
    """Parse a text, or read the file that it names; `others` are values that it may leave out."""
    examples = ", ".join(kind.example for kind in kinds.values())
    if not isinstance(text, str) or not text.strip():
        raise ParameterError(what, quoted(text), f"a file or one of {examples}")
    if len(text) > MOST_LETTERS:
        raise ParameterError(
            f"{what} {quoted(text)}", f"{len(text)} letters", f"{MOST_LETTERS} at most", verb="has"
        )
    name, colon, rest = (part.strip() for part in text.partition(":"))
    kind = kinds.get(name.lower())
    is_there = os.path.exists(text)
    if kind is None or (is_there and not colon):
        # A colon after one letter belongs to a drive of Windows.
        is_path = not colon or len(name) == 1
        # What follows the last dot of a range is a number.
        if is_there or (is_path and Path(text).suffix[1:2].isalpha()):
            return read(text, duration=duration)
        raise ParameterError(
            f"{what} {quoted(text)}",
            "neither a file nor a known kind",
            f"a file or one of {examples}",
        )
    try:
        values = {**others, **_values(kind, rest)}
        if duration is not None:
            values.setdefault("duration", duration)
        elif kind.make in (sine, triangle) and "frequency" in values:
            # One that is not above 0 is refused as such.
            frequency = values["frequency"]
            values.setdefault("duration", PERIODS / frequency if frequency > 0.0 else PERIODS)
        if missing := [argument for argument in kind.needed if argument not in values]:
            called = MISSING.get(missing[0], missing[0])
            raise ParameterError(f"there is no {called}: {kind.expected}")
        return kind.make(**values)
    except ParameterError as error:
        raise error.of(f"{what} {quoted(text)}", argument=what) from None


def _values(kind: Kind, text: str) -> dict[str, Any]:
    """Return the values of a text by argument."""
    values: dict[str, Any] = {}
    for item in filter(None, (part.strip() for part in text.split(","))):
        keyword, equals, written = (part.strip() for part in item.rpartition("="))
        numbers, quantity, join = numbers_with_unit(written)
        if equals and keyword not in kind.keywords:
            known = ", ".join(kind.keywords)
            raise ParameterError(f"{quoted(keyword)} is not one of {known}: {kind.expected}")
        if equals and quantity != (wanted := kind.keywords[keyword]):
            units = UNITS[wanted]
            raise ParameterError(
                quoted(item), "the wrong unit", f"{wanted}, unit {units}", verb="has"
            )
        if equals and join != ("/" if keyword in LISTS else ""):
            raise ParameterError(f"{quoted(item)} cannot be understood: {kind.expected}")
        names = (keyword,) if equals else kind.items.get((quantity, join))
        if names is None:
            problem = "has no unit" if quantity == "number" else "has no place here"
            raise ParameterError(f"{quoted(item)} {problem}: {kind.expected}")
        if names == ("low", "high") and not numbers[0] < numbers[1]:
            low, high = _as_written(written)
            raise ParameterError("low", low, f"less than high, {high}")
        for name, number in zip(names, [numbers] if names[0] in LISTS else numbers, strict=True):
            if name in values:
                raise ParameterError(f"{quoted(item)} gives {name} a second time: {kind.expected}")
            values[name] = number
    return values


def _as_written(text: str) -> list[str]:
    """Write each value of a range as it was typed, with its unit."""
    found = _VALUE.findall(text.replace("..", " "))
    return [f"{number} {unit or found[-1][1]}" for number, unit in found]


def numbers_with_unit(text: str) -> tuple[list[float], str, str]:
    """Parse one value or several: the numbers in SI, their quantity and their separator."""
    if "..." in text:
        raise ParameterError(quoted(text), "three dots", "two, as in 0..110um", verb="has")
    join = next((mark for mark in ("..", "/") if mark in text), "")
    values = []
    for part in text.split(join) if join else [text]:
        match = _VALUE.fullmatch(part.strip())
        if match is None:
            hint = "; a range has two dots, as in 0..110um" if _RANGE.match(part) else ""
            raise ParameterError(
                f"{quoted(part.strip())} in {quoted(text)} is not a number with its unit{hint}"
            )
        values.append((float(match[1]), match[2]))
    if join == ".." and len(values) != 2:
        raise ParameterError(
            quoted(text), f"{len(values)} values", "two, as in 0..110um", verb="has"
        )
    # The last unit counts for the values before it that have none.
    units = [_unit(name or values[-1][1]) for _, name in values]
    if len({unit.quantity for unit in units}) > 1:
        raise ParameterError(f"{quoted(text)} mixes {units[0].name} and {units[-1].name}")
    numbers = [
        number * unit.factor / unit.divisor for (number, _), unit in zip(values, units, strict=True)
    ]
    if units[0] is PLAIN:
        numbers = [int(number) if number.is_integer() else number for number in numbers]
    return numbers, units[0].quantity, join


def _unit(name: str) -> Unit:
    unit = PLAIN if not name else OTHER_UNITS.get(name) or lookup(name)
    if unit is None:
        known = ", ".join(UNITS[quantity] for quantity in ("frequency", "displacement", "time"))
        raise ParameterError(f"unknown unit {quoted(name)}: expected one of {known}")
    return unit


PLACED = {"centre": "displacement", "ramp": "time"}
PATHS = {
    "circle": Kind(
        circle,
        "circle:FREQUENCY,RADIUS[,DURATION][,phase=ANGLE][,centre=X/Y][,ramp=TIME]",
        "circle:0.1Hz,10um",
        {
            ("frequency", ""): ("frequency",),
            ("displacement", ""): ("radius",),
            ("time", ""): ("duration",),
        },
        {"phase": "angle", **PLACED},
        ("frequency", "radius"),
    ),
    "lissajous": Kind(
        lissajous,
        "lissajous:FX/FY,AX/AY[,DURATION][,phase=ANGLE][,centre=X/Y][,ramp=TIME]",
        "lissajous:0.2/0.3Hz,20/20um",
        {
            ("frequency", "/"): ("frequencies",),
            ("displacement", "/"): ("sizes",),
            ("time", ""): ("duration",),
        },
        {"phase": "angle", **PLACED},
        ("frequencies", "sizes"),
    ),
    "raster": Kind(
        raster,
        "raster:RATE,WIDTH/HEIGHT,lines=NUMBER[,flyback=SHARE][,DURATION][,centre=X/Y][,ramp=TIME]",
        "raster:1Hz,20/20um,lines=9",
        {
            ("frequency", ""): ("line_rate",),
            ("displacement", "/"): ("sizes",),
            ("time", ""): ("duration",),
        },
        {"lines": "number", "flyback": "number", **PLACED},
        ("line_rate", "sizes", "lines"),
    ),
    "spiral": Kind(
        spiral,
        "spiral:FREQUENCY,RADIUS,pitch=LENGTH[,centre=X/Y][,ramp=TIME]",
        "spiral:0.5Hz,20um,pitch=2um",
        {("frequency", ""): ("frequency",), ("displacement", ""): ("radius",)},
        {"pitch": "displacement", **PLACED},
        ("frequency", "radius", "pitch"),
    ),
}


def parse_path(
    text: str,
    *,
    duration: float | None = None,
    centre: tuple[float, float] | None = None,
    origin: tuple[float, float] | None = HOME,
) -> XYReference:
    r"""Make a path from a text, as the command line takes it.

    =================================  =====================================================
    ``circle:0.1Hz,10um``              frequency and radius; optional duration,
                                       ``phase=90deg``
    ``lissajous:0.2/0.3Hz,20/20um``    frequencies and amplitudes of x and y; optional
                                       duration, ``phase=90deg``
    ``raster:1Hz,20/20um,lines=9``     lines in a second, width and height, lines in a frame;
                                       optional ``flyback=0.25``, duration
    ``spiral:0.5Hz,20um,pitch=2um``    turns in a second, radius, distance of turns
    ``path.csv``                       a file, as `read_path` takes it
    =================================  =====================================================

    All but files take ``centre=58.5/58.5um`` and ``ramp=2s``.

    Parameters
    ----------
    text : str
        The kind and its items, as for `parse_reference`.
    duration : float, optional
        Length [s], where `text` has none; not for a spiral, which has its own.
    centre : (float, float), optional
        Centre [m], where `text` has none; not for a file.
    origin : (float, float) or None, optional
        Position from which the smooth start begins [m], as of `circle`; not for a file.

    Returns
    -------
    XYReference
        As `circle`, `lissajous`, `raster`, `spiral` or `read_path` make it.

    Raises
    ------
    ParameterError
        The text cannot be parsed, or a value cannot be used. The message shows the expected
        form.
    DataError
        The file cannot be read or used.

    Examples
    --------
    >>> import piezotrack as pt
    >>> pt.references.parse_path("circle:0.1Hz,10um,centre=50/50um")
    XYReference(circle 10 um, 0.1 Hz, 40 to 60 by 40 to 60 um, 30 s)
    """
    if duration is not None and str(text).strip().lower().startswith("spiral:"):
        raise ParameterError(
            "duration",
            quoted(duration),
            "none, as radius, pitch and frequency of a spiral are its length",
        )
    others: dict[str, Any] = {"origin": origin}
    if centre is not None:
        others["centre"] = centre
    path: XYReference = made_from_text("path", text, PATHS, read_path, duration, **others)
    return path


def path_of(
    given: XYReference | str | os.PathLike[str],
    *,
    duration: float | None = None,
    period: float | None = None,
    dt: float | None = None,
    centre: tuple[float, float] | None = None,
    origin: tuple[float, float] | None = HOME,
) -> XYReference:
    """Return a path, or make it from a text or a file.

    Parameters
    ----------
    given : XYReference, str or path-like
        A path, a text as of `parse_path`, or a file as of `read_path`.
    duration, centre, origin : optional
        As of `parse_path`; `centre` has no effect on a file.
    period, dt : float, optional
        As of `read_path`, of a file [s].

    Returns
    -------
    XYReference
        `given` itself where it is one.

    Raises
    ------
    ParameterError
        It is none of these, or `period` or `dt` is given with a text; ``argument`` is ``"path"``.
    DataError
        The file cannot be read or used.

    Examples
    --------
    >>> path_of("circle:0.1Hz,10um,centre=50/50um").duration
    30.0
    """
    if not isinstance(given, str | os.PathLike):
        expect("path", given, XYReference, "pt.XYReference or a text, as 'circle:0.1Hz,10um'")
        return given
    text = os.fspath(given)
    if os.path.isfile(text):
        return read_path(text, duration=duration, period=period, dt=dt, origin=origin)
    for name, value in (("period", period), ("dt", dt)):
        if value is not None:
            raise ParameterError(name, "for a path from a file", f"none with {quoted(text)}")
    return parse_path(text, duration=duration, centre=centre, origin=origin)
