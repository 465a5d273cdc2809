"""Units of logs and plots.

Everything inside piezotrack is in seconds, volts and metres. The table here is the one place
where other units are converted. The drive of a stage is in volts, newtons, or metres where a
closed-loop axis, as the height of an AFM, is given a position.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..errors import ParameterError
from .messages import quoted

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "OTHER_UNITS",
    "Unit",
    "best_length_unit",
    "decibels",
    "drive_text",
    "drive_word",
    "known_units",
    "length_text",
    "lookup",
    "of_drive",
    "require",
    "shown_unit",
    "split_unit",
    "symbol_of",
]


@dataclass(frozen=True)
class Unit:
    """A unit and its conversion to SI: ``value * factor / divisor``.

    One of `factor` and `divisor` is 1 and the other a number that float64 holds exactly, so a
    conversion rounds once. (1e-6 is not exact: multiplying by it rounds twice.)

    Attributes
    ----------
    name : str
        The unit in ASCII, e.g. ``"um"``.
    quantity : str
        ``"time"``, ``"voltage"`` or ``"displacement"``.
    si : str
        The SI unit of the quantity: ``"s"``, ``"V"`` or ``"m"``.
    factor, divisor : float
        Multiplier and divisor.
    """

    name: str
    quantity: str
    si: str
    factor: float = 1.0
    divisor: float = 1.0

    def to_si(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `values`, an array of any shape in this unit, in SI.

        Examples
        --------
        >>> import numpy as np
        >>> from piezotrack._support.units import require
        >>> require("um").to_si(np.array([45.1]))
        array([4.51e-05])
        """
        converted: NDArray[np.float64] = values * self.factor / self.divisor
        return converted


_TABLE = (
    Unit("s", "time", "s"),
    Unit("ms", "time", "s", divisor=1e3),
    Unit("us", "time", "s", divisor=1e6),
    Unit("ns", "time", "s", divisor=1e9),
    Unit("min", "time", "s", factor=60.0),
    Unit("V", "voltage", "V"),
    Unit("mV", "voltage", "V", divisor=1e3),
    Unit("uV", "voltage", "V", divisor=1e6),
    Unit("kV", "voltage", "V", factor=1e3),
    Unit("m", "displacement", "m"),
    Unit("mm", "displacement", "m", divisor=1e3),
    Unit("um", "displacement", "m", divisor=1e6),
    Unit("nm", "displacement", "m", divisor=1e9),
    Unit("pm", "displacement", "m", divisor=1e12),
)
# Units of references and loops, which no column of a log has.
OTHER_UNITS = {
    "Hz": Unit("Hz", "frequency", "Hz"),
    "hz": Unit("Hz", "frequency", "Hz"),
    "mHz": Unit("mHz", "frequency", "Hz", divisor=1e3),
    "kHz": Unit("kHz", "frequency", "Hz", factor=1e3),
    "rad": Unit("rad", "angle", "rad"),
    "deg": Unit("deg", "angle", "rad", factor=math.pi, divisor=180.0),
}
_BY_NAME = {unit.name: unit for unit in _TABLE} | {
    other: unit for unit in _TABLE if unit.name == "um" for other in ("micron", "microns")
}
_BY_LOWER = {name.lower(): unit for name, unit in _BY_NAME.items()}

# Units that acquisition software states in words, as a property of a channel. In the title of a
# column they are words like any other.
_IN_WORDS = {
    "second": "s",
    "sec": "s",
    "millisecond": "ms",
    "microsecond": "us",
    "nanosecond": "ns",
    "minute": "min",
    "volt": "V",
    "millivolt": "mV",
    "microvolt": "uV",
    "kilovolt": "kV",
    **{
        f"{part}{word}": f"{symbol}m"
        for word in ("meter", "metre")
        for part, symbol in (("", ""), ("milli", "m"), ("micro", "u"), ("nano", "n"), ("pico", "p"))
    },
}

# What AFM software writes in brackets behind the name of a height.
_SENSORS = ("piezo", "measured", "smoothed")
# Units that tables show in place of SI units, and the factor.
_SHOWN = {"m": ("um", 1e6), "m/V": ("um/V", 1e6), "m/m": ("um/um", 1.0)}

# The micro sign and the Greek letter mu are different characters.
_MICRO = str.maketrans({"\N{MICRO SIGN}": "u", "\N{GREEK SMALL LETTER MU}": "u"})


def lookup(text: str) -> Unit | None:
    """Return the unit that `text` names, or None where it names none.

    Upper and lower case may differ from the table only where the text is all of one case and
    cannot mean something else: ``v`` is V and ``UM`` is um, but ``MV`` would be megavolt and
    ``Nm`` is a torque.

    Examples
    --------
    >>> from piezotrack._support.units import lookup
    >>> lookup("UM").name, lookup("MV"), lookup("furlong")
    ('um', None, None)
    """
    plain = text.strip().translate(_MICRO)
    if plain in _BY_NAME:
        return _BY_NAME[plain]
    unit = _BY_LOWER.get(plain.lower())
    if unit is None or not (plain.islower() or plain.isupper()):
        return None
    is_mega = plain in ("MM", "MS", "MV")
    return None if is_mega else unit


def symbol_of(text: str) -> str:
    """Return the symbol of a unit that a file states, in words or as a symbol.

    Examples
    --------
    >>> from piezotrack._support.units import symbol_of
    >>> symbol_of("Volts"), symbol_of("micrometers"), symbol_of(" um "), symbol_of("K")
    ('V', 'um', 'um', 'K')
    """
    plain = text.strip()
    word = plain.lower()
    return _IN_WORDS.get(word) or _IN_WORDS.get(word.removesuffix("s")) or plain


def require(text: str, *quantities: str) -> Unit:
    """Return the unit that `text` names.

    Parameters
    ----------
    text : str
        The unit, e.g. ``"um"``.
    *quantities : {"time", "voltage", "displacement"}
        What the unit may measure; anything by default.

    Raises
    ------
    ParameterError
        The unit is not known, or it measures another quantity. The message lists the known ones.

    Examples
    --------
    >>> from piezotrack._support.units import require
    >>> require("mV", "voltage").si
    'V'
    """
    unit = lookup(text)
    if unit is None:
        raise ParameterError(
            f"unknown unit {quoted(text)}: expected one of {known_units(*quantities)}",
            argument="units",
        )
    if quantities and unit.quantity not in quantities:
        raise ParameterError(
            quoted(text),
            f"a unit of {unit.quantity}",
            f"a unit of {' or '.join(quantities)}, one of {known_units(*quantities)}",
        )
    return unit


def known_units(*quantities: str) -> str:
    """Return the names of the units of `quantities` (of all where none), separated by commas.

    Examples
    --------
    >>> from piezotrack._support.units import known_units
    >>> known_units("voltage")
    'V, mV, uV, kV'
    """
    return ", ".join(
        unit.name for unit in _TABLE if unit.quantity in (quantities or (unit.quantity,))
    )


def split_unit(header: str) -> tuple[str, str]:
    """Split the title of a column into its name and the text of its unit.

    A unit in brackets or after a slash is taken as it stands, but for ``(piezo)`` and
    ``(measured)``, which belong to the name of a height. After an underscore or a space it is taken
    only if it is a known unit: ``sensor_left`` is a name.

    Examples
    --------
    >>> from piezotrack._support.units import split_unit
    >>> split_unit("voltage_V"), split_unit("Time (s)"), split_unit("x/um")
    (('voltage', 'V'), ('Time', 's'), ('x', 'um'))
    >>> split_unit("sensor_left"), split_unit("height (piezo) [um]")
    (('sensor_left', ''), ('height (piezo)', 'um'))
    """
    title = header.strip()
    if title.endswith((")", "]")):
        opened = max(title.rfind("("), title.rfind("["))
        inside = title[opened + 1 : -1]
        if inside.lower() in _SENSORS:
            return title, ""
        if opened >= 0 and ")" not in inside and "]" not in inside:
            return title[: _end(title, opened, "_")].strip(), inside.strip()
    name, slash, unit = title.rpartition("/")
    if slash and name.strip():
        return name.strip(), unit.strip()
    # Never the whole title: before the mark there is a letter at least.
    start = max(title.rfind(mark) for mark in ("_", ",", *_blanks(title))) + 1
    end = max(1, _end(title, start, "_,"))
    if end < start < len(title) and lookup(title[start:]):
        return title[:end], title[start:]
    return title, ""


def _end(title: str, end: int, marks: str) -> int:
    """Return where a title ends without the blanks and marks before `end`."""
    while end and (title[end - 1].isspace() or title[end - 1] in marks):
        end -= 1
    return end


def _blanks(title: str) -> set[str]:
    return {letter for letter in set(title) if letter.isspace()}


def decibels(factor: float) -> float:
    """Return a factor on an amplitude in dB; minus infinity for 0.

    Examples
    --------
    >>> from piezotrack._support.units import decibels
    >>> round(decibels(2.0), 2), decibels(0.0)
    (6.02, -inf)
    """
    return 20.0 * math.log10(factor) if factor > 0.0 else -math.inf


def best_length_unit(stroke_m: float) -> tuple[str, float]:
    """Choose the unit in which a displacement is easy to read.

    Parameters
    ----------
    stroke_m : float
        The largest displacement to show [m]; the sign does not matter.

    Returns
    -------
    name : str
        ``"nm"`` below 1 um, ``"mm"`` from 1 mm on, ``"um"`` between them and where `stroke_m`
        is zero or not finite.
    scale : float
        Factor from metres to this unit.

    Examples
    --------
    >>> from piezotrack._support.units import best_length_unit
    >>> best_length_unit(45e-6)
    ('um', 1000000.0)
    """
    size = abs(stroke_m)
    if not math.isfinite(size) or size == 0.0 or 1e-6 <= size < 1e-3:
        return "um", 1e6
    return ("nm", 1e9) if size < 1e-6 else ("mm", 1e3)


def length_text(metres: float, digits: int = 4) -> str:
    """Write a length in the unit in which it is easy to read.

    Parameters
    ----------
    metres : float
        The length [m].
    digits : int, optional
        Significant digits.

    Returns
    -------
    str
        Number and unit.

    Examples
    --------
    >>> length_text(45.678e-6), length_text(40.0)
    ('45.68 um', '40 m')
    """
    size = abs(metres)
    if size >= 1.0:
        return f"{metres:.{digits}g} m"
    if 0.0 < size < 1e-9:
        return f"{1e12 * metres:.{digits}g} pm"
    unit, scale = best_length_unit(metres)
    return f"{scale * metres:.{digits}g} {unit}"


def of_drive(unit: str, drive: str) -> str:
    """Return the unit of a parameter of a stage whose drive is not in volts.

    Parameters
    ----------
    unit : str
        Unit for a drive in volts, SI.
    drive : str
        Unit of the drive, SI.

    Returns
    -------
    str
        The unit with metres in place of volts for a drive in metres; otherwise as it is.

    Examples
    --------
    >>> from piezotrack._support.units import of_drive
    >>> of_drive("m/V", "m"), of_drive("V", "m"), of_drive("N/V", "V")
    ('m/m', 'm', 'N/V')
    """
    return unit.replace("V", "m") if drive == "m" else unit


def shown_unit(unit: str) -> tuple[str, float]:
    """Return the unit in which tables and pictures show values in an SI unit, and the factor.

    Parameters
    ----------
    unit : str
        SI unit.

    Returns
    -------
    name : str
        Unit shown.
    scale : float
        Factor from the SI unit to it.

    Examples
    --------
    >>> from piezotrack._support.units import shown_unit
    >>> shown_unit("m"), shown_unit("V")
    (('um', 1000000.0), ('V', 1.0))
    """
    return _SHOWN.get(unit, (unit, 1.0))


def drive_word(unit: str) -> str:
    """Return what a drive in an SI unit is called: ``"voltage"``, or ``"drive"`` in any other.

    Examples
    --------
    >>> from piezotrack._support.units import drive_word
    >>> drive_word("V"), drive_word("m")
    ('voltage', 'drive')
    """
    return "voltage" if unit == "V" else "drive"


def drive_text(value: float, unit: str, digits: int = 4) -> str:
    """Write a drive with its unit.

    Parameters
    ----------
    value : float
        The drive, SI.
    unit : str
        Its unit, SI.
    digits : int, optional
        Significant digits.

    Returns
    -------
    str
        Number and unit; micrometres for a drive in metres.

    Examples
    --------
    >>> from piezotrack._support.units import drive_text
    >>> drive_text(75.0, "V"), drive_text(4e-5, "m")
    ('75 V', '40 um')
    """
    name, scale = shown_unit(unit)
    return f"{scale * value:.{digits}g} {name}"
