import copy
import hashlib
import pickle
import re
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import piezotrack as pt
from piezotrack._support.units import best_length_unit, known_units, lookup, require, split_unit


def record(n: int = 5000, dt: float = 0.005, **more: Any) -> pt.Dataset:
    u = 5.0 * np.sin(np.arange(n) / 500.0)
    return pt.Dataset(u=u, y=4e-6 * u, dt=dt, **more)


def grid(n: int = 100) -> NDArray[np.float64]:
    return 0.01 * np.arange(n, dtype=np.float64)


def replaced(values: Any, index: Any, value: float) -> NDArray[np.float64]:
    changed = np.array(values, dtype=float)
    changed[index] = value
    return changed


ONE = np.ones(100)
GOOD: dict[str, Any] = {"u": ONE, "y": ONE, "dt": 0.01}


BAD: list[tuple[dict[str, Any], type[Exception], str]] = [
    ({"y": np.ones(99)}, pt.ShapeError, "u has 100 samples and y has 99"),
    ({"t": grid(7), "dt": None}, pt.ShapeError, "u has 100 samples and t has 7"),
    ({"columns": {"ref": [1.0]}}, pt.ShapeError, "column 'ref' has 1"),
    ({"u": ONE[:, None]}, pt.ShapeError, "u has the shape (100, 1): expected one dimension"),
    ({"y": 3.0}, pt.ShapeError, "y has the shape ()"),
    ({"u": [[1.0], [1.0, 2.0]]}, pt.ShapeError, "u is not an array"),
    ({"u": "abc"}, pt.DataError, "u holds values of type <U3"),
    ({"u": ["1", "2", "3"]}, pt.DataError, "u holds values of type <U1"),
    ({"y": [1.0, None, 2.0]}, pt.DataError, "y holds values of type object"),
    ({"y": ONE * 1j}, pt.DataError, "y holds values of type complex128"),
    ({"u": None}, pt.DataError, "u holds values of type object"),
    ({"u": [10**400, 1, 2]}, pt.DataError, "u holds values of type object"),
    (
        {"t": np.arange(100).astype("M8[s]"), "dt": None},
        pt.DataError,
        "t holds values of type date",
    ),
    ({"u": [1.0, 2.0], "y": [1.0, 2.0]}, pt.DataError, "u has 2 samples"),
    ({"u": [], "y": []}, pt.DataError, "u has 0 samples"),
    ({"u": replaced(ONE, [17, 30], np.nan)}, pt.DataError, "u is nan at sample 17"),
    ({"y": replaced(ONE, 99, -np.inf)}, pt.DataError, "y is -inf at sample 99"),
    ({"y": np.ma.masked_equal(np.arange(100), 5)}, pt.DataError, "y is nan at sample 5"),
    ({"t": replaced(grid(), 3, np.nan), "dt": None}, pt.DataError, "t is nan at sample 3"),
    (
        {"t": replaced(grid(), 20, 0.01), "dt": None},
        pt.DataError,
        "t goes from 0.19 s to 0.01 s at sample 20",
    ),
    ({"t": replaced(grid(), 20, 0.19), "dt": None}, pt.DataError, "can be given with dt="),
    (
        {"t": np.delete(grid(101), 40), "dt": None},
        pt.DataError,
        "t is not even: it goes 0.02 s forward to sample 40, where most steps are 0.01 s",
    ),
    (
        # No step is off by 5 %, and yet the clock drifts.
        {"t": np.cumsum(np.linspace(0.0098, 0.0102, 100)), "dt": None},
        pt.DataError,
        "is 0.000582 s off an even grid of 0.010002 s",
    ),
    (
        {"t": [-1e308, 0.0, 1e308], "u": [1, 2, 3], "y": [1, 2, 3], "dt": None},
        pt.DataError,
        "below",
    ),
    ({"dt": 0.0}, pt.ParameterError, "dt is 0.0"),
    ({"dt": -1}, pt.ParameterError, "dt is -1"),
    ({"dt": np.inf}, pt.ParameterError, "dt is inf"),
    ({"dt": np.nan}, pt.ParameterError, "dt is nan"),
    ({"dt": "fast"}, pt.ParameterError, "dt is 'fast'"),
    ({"dt": True}, pt.ParameterError, "dt is True"),
    ({"dt": 10**400}, pt.ParameterError, "dt is 1000"),
    ({"dt": None}, pt.ParameterError, "t and dt"),
    ({"t": grid()}, pt.ParameterError, "t and dt"),
    ({"hold": "linear"}, pt.ParameterError, "hold is 'linear'"),
    ({"hold": ["foh"]}, pt.ParameterError, "hold is ['foh']"),
    ({"drive_unit": 1}, pt.ParameterError, "drive_unit is 1"),
    ({"source": b"x"}, pt.ParameterError, "source is b'x'"),
    ({"columns": [1.0]}, pt.ParameterError, "columns is [1.0]"),
    ({"columns": {1: ONE}}, pt.ParameterError, "1 is not the name of a column"),
    ({"columns": {"a": ["x"] * 100}}, pt.DataError, "column 'a' holds values of type <U1"),
    ({"column_units": {"a": "V"}}, pt.ParameterError, "'a' is not the name of a column"),
    ({"columns": {"a": ONE}, "column_units": {"a": 1}}, pt.ParameterError, "has 1 for 'a'"),
]


@pytest.mark.parametrize(("arguments", "error", "message"), BAD, ids=[case[2] for case in BAD])
def test_refuses_what_is_not_a_record(
    arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=re.escape(message)) as caught:
        pt.Dataset(**(GOOD | arguments))
    assert type(caught.value) is error
    assert "\n" not in str(caught.value)


def test_holds_float64_copies_that_cannot_be_changed() -> None:
    u = np.arange(6, dtype=np.int16)[::2]
    y = [0.0, 1e-6, 2e-6]
    log = pt.Dataset(u=u, y=y, dt=0.5, columns={"ref": [1.0, np.nan, 3.0]})
    u[0] = 100
    assert log.u.tolist() == [0.0, 2.0, 4.0]
    assert log.t.tolist() == [0.0, 0.5, 1.0]
    for array in (log.t, log.u, log.y, log.columns["ref"]):
        assert array.dtype == np.float64
        assert array.flags.c_contiguous
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(AttributeError):
        log.u = log.y  # type: ignore[misc]
    with pytest.raises(TypeError):
        log.columns["ref"] = log.u  # type: ignore[index]


def test_properties() -> None:
    log = record(hold="zoh", drive_unit="A", columns={"ref": np.zeros(5000)}, source="stage.csv")
    assert (log.dt, log.hold, log.drive_unit, log.source) == (0.005, "zoh", "A", "stage.csv")
    assert len(log) == 5000
    assert log.duration == 25.0
    assert log.stroke == pytest.approx(4e-5, rel=1e-4)
    assert log.warmup == 0
    assert dict(log.column_units) == {"ref": ""}
    u, y = log
    assert np.array_equal(u, log.u)
    assert np.array_equal(y, log.y)
    assert repr(log) == "Dataset(5000 samples, 25 s at 200 Hz, stroke 40 um)"


def test_times_give_the_interval_and_keep_their_origin() -> None:
    log = pt.Dataset(u=ONE, y=ONE, t=7.0 + grid())
    assert log.dt == pytest.approx(0.01, rel=1e-12)
    assert log.t[0] == 7.0
    assert log[7.5:7.7].t.tolist() == pytest.approx(7.5 + grid(20))


def test_small_jitter_is_not_uneven() -> None:
    jitter = 1e-4 * np.random.default_rng(1).uniform(-1.0, 1.0, 100)
    log = pt.Dataset(u=ONE, y=ONE, t=grid() + jitter)
    assert len(log[0.0:1.0]) == 100


def test_a_window_keeps_the_earlier_drive_and_drops_the_later() -> None:
    log = record(columns={"k": np.arange(5000)})
    window = log[3.0:23.0]
    assert (len(window), window.warmup, len(window.full)) == (4000, 600, 4600)
    assert window.t[0] == 3.0
    assert window.t[-1] == pytest.approx(22.995)
    assert np.array_equal(window.u, log.u[600:4600])
    assert np.array_equal(window.columns["k"], np.arange(600, 4600))
    assert np.array_equal(window.full.u, log.u[:4600])
    assert window.full.warmup == 0
    assert window.dt == log.dt
    assert repr(window).endswith("stroke 40 um, warm-up 600 samples)")


def test_a_window_of_a_window_narrows_it() -> None:
    log = record()
    once, twice = log[5.0:10.0], log[3.0:23.0][5.0:10.0]
    assert once.sha256 == twice.sha256
    assert twice.warmup == 1000
    assert log[3.0:][:].warmup == 600
    with pytest.raises(pt.ParameterError, match=r"go from 3 s to 22\.995 s"):
        log[3.0:23.0][1.0:10.0]


def test_cut_forgets_the_earlier_drive() -> None:
    log = record()
    part = log.cut(3.0, 23.0)
    assert (len(part), part.warmup, part.t[0]) == (4000, 0, 3.0)
    assert part.full.sha256 == part.sha256
    assert len(log[3.0:23.0].cut()) == 4000
    assert log[3.0:23.0].cut(5.0).t[0] == 5.0
    with pytest.raises(pt.ParameterError, match="is empty"):
        log.cut(5.0, 4.0)


@pytest.mark.parametrize("dt", [0.1, 0.005, 1 / 3, 1e-5, 0.02])
def test_bounds_on_a_sample_do_not_depend_on_rounding(dt: float) -> None:
    log = record(1000, dt=dt)
    for k in range(0, 900, 7):
        for start in (
            k * dt,
            float(f"{k * dt:.12g}"),
            float(np.cumsum(np.full(k + 1, dt))[-1]) - dt,
        ):
            window = log[start : start + 50 * dt]
            assert (window.warmup, len(window)) == (k, 50)


def test_bounds_are_real_numbers() -> None:
    log = record(100, dt=0.25)
    bounds: list[Any] = [1, np.float32(1.0), np.int64(1), Fraction(1)]
    assert {log[bound:].warmup for bound in bounds} == {4}


BAD_WINDOWS: list[tuple[Any, str]] = [
    (5, "window is 5: expected a slice in seconds"),
    (2.5, "window is 2.5"),
    ((slice(0, 1), slice(0, 1)), "expected a slice"),
    (slice(0.0, 10.0, 2), "window has a step of 2"),
    (slice("a", None), "start is 'a': expected a finite number of seconds or None"),
    (slice(None, float("nan")), "stop is nan"),
    (slice(float("-inf"), None), "start is -inf"),
    (slice(True, None), "start is True"),
    (slice(1j, None), "start is 1j"),
    (slice(10.0, 10.0), "is empty"),
    (slice(10.0, 3.0), "is empty"),
    (slice(30.0, None), "is empty"),
    (slice(30.0, 40.0), "reaches out of the record, whose samples go from 0 s to 24.995 s"),
    (slice(3.0, 3000.0), "from 3 s to 3000 s reaches out of"),
    (slice(-1.0, None), "reaches out of"),
    (slice(3.0, 3.008), "holds 2 samples"),
]


@pytest.mark.parametrize(("window", "message"), BAD_WINDOWS, ids=[w[1] for w in BAD_WINDOWS])
def test_refuses_a_window(window: Any, message: str) -> None:
    with pytest.raises(pt.ParameterError, match=re.escape(message)):
        record()[window]


def test_fingerprint_is_of_the_numbers() -> None:
    log = pt.Dataset(u=[0.0, 1.0, 2.0, 3.0], y=[0.0, 1.0, 4.0, 9.0], dt=0.5)
    numbers = [0.5, 0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 4.0, 9.0, 1.0]
    expected = hashlib.sha256(np.array(numbers, dtype="<f8").tobytes()).hexdigest()
    assert log[0.5:].sha256 == expected
    assert log[0.5:].sha256 == log[0.5:].sha256
    assert log.sha256 != expected
    assert log.sha256 != pt.Dataset(u=log.u, y=log.y, dt=0.25).sha256


@pytest.mark.parametrize(
    "duplicate", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))]
)
def test_copies_and_pickles_are_equal_and_read_only(duplicate: Any) -> None:
    log = record(hold="zoh", columns={"ref": np.ones(5000)}, column_units={"ref": "V"})[3.0:23.0]
    other = duplicate(log)
    assert other.sha256 == log.sha256
    assert repr(other) == repr(log)
    assert (other.hold, other.warmup, dict(other.column_units)) == ("zoh", 600, {"ref": "V"})
    assert np.array_equal(other.columns["ref"], log.columns["ref"])
    for array in (other.t, other.u, other.y, other.columns["ref"]):
        assert not array.flags.writeable


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("um", "um"),
        ("\N{MICRO SIGN}m", "um"),
        ("\N{GREEK SMALL LETTER MU}m", "um"),
        ("UM", "um"),
        (" micron ", "um"),
        ("Microns", None),
        ("v", "V"),
        ("mv", "mV"),
        ("KV", "kV"),
        ("MV", None),
        ("MM", None),
        ("Nm", None),
        ("S", "s"),
        ("MIN", "min"),
        ("", None),
        ("furlong", None),
    ],
)
def test_units_are_found_where_they_are_clear(text: str, name: str | None) -> None:
    unit = lookup(text)
    assert (None if unit is None else unit.name) == name


def test_units_say_what_they_know() -> None:
    assert known_units("time") == "s, ms, us, ns, min"
    with pytest.raises(pt.ParameterError, match="unknown unit 'in': expected one of s, ms"):
        require("in")
    with pytest.raises(pt.ParameterError, match=r"'V' is a unit of voltage: expected .* m, mm, um"):
        require("V", "displacement")


def test_conversion_rounds_once() -> None:
    numbers = np.round(np.random.default_rng(2).uniform(-130.0, 130.0, 2000), 6)
    for unit, exponent in (("um", 6), ("nm", 9), ("mm", 3), ("pm", 12)):
        metres = require(unit).to_si(numbers)
        exact = [float(Fraction(x) / 10**exponent) for x in numbers.tolist()]
        assert metres.tolist() == exact


@pytest.mark.parametrize(
    ("title", "parts"),
    [
        ("time_s", ("time", "s")),
        ("Time (s)", ("Time", "s")),
        ("Voltage [V]", ("Voltage", "V")),
        ("Voltage_[V]", ("Voltage", "V")),
        ("displacement/um", ("displacement", "um")),
        ("x (\N{MICRO SIGN}m)", ("x", "\N{MICRO SIGN}m")),
        ("drive voltage mV", ("drive voltage", "mV")),
        ("Time, s", ("Time", "s")),
        ("sensor_left", ("sensor_left", "")),
        ("gain (a.u.)", ("gain", "a.u.")),
        ("um", ("um", "")),
        ("", ("", "")),
    ],
)
def test_titles_are_split_into_name_and_unit(title: str, parts: tuple[str, str]) -> None:
    assert split_unit(title) == parts


def test_length_unit_suits_the_stroke() -> None:
    strokes = [3e-9, 1e-6, -110e-6, 1e-3, 0.0, float("nan")]
    assert [best_length_unit(s)[0] for s in strokes] == ["nm", "um", "um", "mm", "um", "um"]
    assert best_length_unit(1e-7) == ("nm", 1e9)
