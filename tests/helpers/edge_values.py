"""What the fuzzers put in place of an argument: mostly what belongs there, often not quite.

A `Slot` is an argument with a value that is right and a strategy for others; `arguments` leaves
most slots of a call right and draws the rest, so that the calls get past the first check.
"""

from __future__ import annotations

import dataclasses
import math
import re
from typing import TYPE_CHECKING, Any

import numpy as np
from hypothesis import strategies as st

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    Strategy = st.SearchStrategy[Any]
    Draw = Callable[[Strategy], Any]

SIZES = [0.0, 1.0, 5e-324, 1e-300, 1e-15, 1e99, 1e100, 1e150, 1e300]
EXTREMES = [
    *SIZES, *(-size for size in SIZES), math.nan, math.inf, -math.inf, 2.3e-308, 9.91e37,
    1.7976931348623157e308, 2.0**53, 2.0**63, 0.9999999999999999, 1.0000000000000002,
]  # fmt: skip
NOT_NUMBERS: list[Any] = [
    *(None, True, False, "1", "", b"1", 10**400, -(10**400), 2**63, 2**64, -1, 0, 7, 1j),
    *(np.float32(1.5), np.float64(math.nan), np.int8(3), np.uint64(2**63), np.bool_(True)),
    *([], [1.0], {}, object, np.array(2.0), np.array([1.0])),
]
COUNTS = [0, 1, 2, 3, -1, 1000, 2**31, 2**32, 2**63, 2**64, 10**30]
NOT_SIGNALS: list[Any] = [
    *([], None, "abc", 3.0, range(5), (0, 1, 2), [[1.0], [1.0, 2.0]], [10**400, 1], [None, 1.0]),
    *(np.zeros((3, 3)), np.array(["a"]), np.zeros(5, dtype=complex), np.zeros(5, dtype=bool)),
    *(np.zeros(5, dtype=object), np.zeros(5, dtype=">f8"), np.zeros(5, dtype=np.float16)),
    *(np.zeros(5, dtype="M8[s]"), np.arange(6.0)[::-1], np.arange(12.0)[::2]),
    *(
        np.full(4, 1e308),
        np.full(4, 5e-324),
        np.ma.masked_array([1.0, 2.0, 3.0], [False, True, False]),
    ),
    np.zeros(8, dtype=[("u", "<f8"), ("n", "<i4")])["u"],
]


@dataclasses.dataclass(frozen=True)
class Slot:
    """An argument: `right` is a value or a strategy, `other` a strategy."""

    right: Any
    other: Strategy

    def draw(self, draw: Draw, *, odd: bool) -> Any:
        if odd:
            return draw(self.other)
        return draw(self.right) if isinstance(self.right, st.SearchStrategy) else self.right


def number(right: float | None, near: float | None = None) -> Slot:
    """A number, `near` saying its size where it is right to leave it out or to give 0."""
    size = near if near is not None else right if right else 1.0
    scaled = st.floats(-1, 1).map(lambda e: float(size) * 10.0**e)
    far = st.floats(-9, 9).map(lambda e: float(size) * 10.0**e)
    opposite = st.just(-float(size))
    extreme = st.sampled_from(EXTREMES)
    return Slot(
        right,
        st.one_of(scaled, scaled, scaled, far, extreme, st.floats(), opposite,
                  st.sampled_from(NOT_NUMBERS)),
    )  # fmt: skip


def finite_number(size: float) -> Strategy:
    """Numbers around a size, and any other finite one."""
    scaled = st.floats(-3, 3).map(lambda e: size * 10.0**e)
    return st.one_of(scaled, scaled, st.floats(allow_nan=False, allow_infinity=False))


def count(right: int | None) -> Slot:
    small = st.integers(0, 40)
    return Slot(right, st.one_of(small, small, st.sampled_from(COUNTS), _sampled(NOT_NUMBERS)))


def word(*right: Any) -> Slot:
    wrong = st.sampled_from(["", "x", right[0].upper() if right[0] else "", None, 1, b"foh"])
    return Slot(right[0], st.one_of(st.sampled_from(right), st.sampled_from(right), wrong))


def truth(right: bool) -> Slot:
    return Slot(right, st.sampled_from([True, False, True, False, None, 0, 1, "no"]))


def numbers(*right: float, most: int = 5) -> Slot:
    """A tuple of numbers."""
    entry = number(right[0] if right else 1.0).other
    wrong = [(), None, "abc", 3.0, [[1.0]], np.zeros((2, 2)), np.zeros(0), {1.0: 2.0}]
    listed = st.lists(entry, max_size=most)
    permuted = st.permutations(right).map(list) if right else listed
    changed = (
        st.tuples(*(st.one_of(st.just(v), number(v).other) for v in right)) if right else listed
    )
    return Slot(right, st.one_of(listed, permuted, changed, changed, st.sampled_from(wrong)))


def signal(longest: int, size: float) -> Slot:
    """Samples: shapes that records have, at any scale, or what is no record."""
    seeds = st.integers(0, 2**32 - 1)
    record = seeds.map(lambda seed: wave(seed, longest, size))
    wild = seeds.map(lambda seed: wave(seed, longest, size * 10.0 ** (seed % 13 - 6)))
    entries = st.lists(st.one_of(finite_number(size), st.sampled_from(EXTREMES)), max_size=12)
    return Slot(record, st.one_of(wild, wild, entries, _sampled(NOT_SIGNALS)))


def wave(seed: int, longest: int, size: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """A record of one of eight shapes."""
    random = np.random.default_rng(seed)
    length = int(random.integers(1, longest))
    t, shape = np.arange(length), seed % 8
    if shape == 0:
        x = np.sin(t / (1 + 30 * random.random()))
    elif shape == 1:
        x = random.standard_normal(length)
    elif shape == 2:
        x = np.cumsum(random.standard_normal(length))
    elif shape == 3:
        x = np.repeat(random.standard_normal(length), 3)[:length]
    elif shape == 4:
        x = np.full(length, random.standard_normal())
    elif shape == 5:
        x = np.round(3 * np.sin(t / 10))
    elif shape == 6:
        x = (t % 7 == 0) * random.standard_normal()
    else:
        x = 1 - np.cos(t / (2 + 8 * random.random()))
    return np.asarray(x * size, dtype=np.float64)


def anything(right: Any, *others: Any) -> Slot:
    """A value and others that may stand in its place."""
    return Slot(right, st.one_of(st.sampled_from(others), _sampled(NOT_NUMBERS)))


def slots_of(value: Any, **others: Slot) -> dict[str, Slot]:
    """Slots for the fields of a dataclass, with its values as those that are right."""
    made: dict[str, Slot] = {}
    for field in dataclasses.fields(value):
        right = getattr(value, field.name)
        if isinstance(right, bool):
            made[field.name] = truth(right)
        elif isinstance(right, int):
            made[field.name] = count(right)
        elif isinstance(right, float):
            made[field.name] = number(right)
        elif isinstance(right, tuple):
            made[field.name] = numbers(*right)
        elif right is None:
            made[field.name] = number(None)
    return {**made, **others}


def arguments(draw: Draw, slots: Mapping[str, Slot], *, most: int = 3) -> dict[str, Any]:
    """Arguments of a call, of which up to `most` are drawn; half of the calls have none odd."""
    names = list(slots)
    odd = draw(st.sets(st.sampled_from(names), max_size=most)) if names else set()
    return {name: slot.draw(draw, odd=name in odd) for name, slot in slots.items()}


def _sampled(values: Sequence[Any]) -> Strategy:
    return st.integers(0, len(values) - 1).map(lambda k: values[k])


# Pieces of the texts that describe references and paths.
ATOMS = [
    *("sine:", "triangle:", "chirp:", "staircase:", "multisine:", "circle:", "lissajous:"),
    *("raster:", "spiral:", "0.2Hz", "1Hz", "0..110um", "10um", ",", "/", "..", "...", "=", ":"),
    *("phase=90deg", "ramp=1s", "rounding=0.2", "dwell=1s", "levels=0/30/10um", "seed=1", "20s"),
    *("0.5/1.3/2.7Hz", "lines=9", "20/20um", "pitch=2um", "centre=58.5/58.5um", "flyback=0.25"),
    *(
        "1e400Hz",
        "nan",
        "inf",
        "-1",
        "1e-300s",
        "1e9",
        "9" * 400,
        " ",
        "\u00b5m",
        "\u03bcm",
        "\x00",
    ),
    *("\n", "\u0663Hz", "1_0Hz", "0x10", "+5", "1e5mHz", "kHz", "/dev/null", "a.csv", ".", "~"),
    *("\u00bd", "1e-5", "\u00b2", "\ud800", "1e308kHz", "1e-320s", "\x1b[31m", "m" * 600),
]
TEXTS = [
    *("sine:0.2Hz,0..110um", "triangle:1Hz,0..50um,rounding=0.2", "chirp:0.1..5Hz,0..110um,20s"),
    *("staircase:5,0..100um,dwell=1s", "staircase:levels=0/30/10um,dwell=1s"),
    *("multisine:0.5/1.3/2.7Hz,0..50um,20s", "circle:0.1Hz,10um", "lissajous:0.2/0.3Hz,20/20um"),
    *("raster:1Hz,20/20um,lines=9", "spiral:0.5Hz,20um,pitch=2um"),
]


@st.composite
def texts(draw: Draw) -> str:
    """A text of a reference with a piece changed, or one of pieces."""
    if draw(st.integers(0, 2)) == 0:
        pieces = st.one_of(st.sampled_from(ATOMS), st.sampled_from(ATOMS), st.text(max_size=3))
        return "".join(draw(st.lists(pieces, max_size=9)))
    text: str = draw(st.sampled_from(TEXTS))
    if draw(st.booleans()):
        # Another number: what is still a text that can be read.
        found = draw(st.sampled_from(list(re.finditer(r"\d+(\.\d+)?", text))))
        number_text = f"{draw(st.floats(0.0, 200.0)):.4g}"
        return text[: found.start()] + number_text + text[found.end() :]
    start = draw(st.integers(0, len(text)))
    piece: str = draw(st.sampled_from([*ATOMS, ""]))
    return text[:start] + piece + text[start + draw(st.integers(0, 3)) :]
