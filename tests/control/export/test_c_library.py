"""The C library: every controller gives the bits that it gives in Python."""

from __future__ import annotations

import ctypes
import math
import os
import subprocess
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

import piezotrack as pt
from c_exports import DAHL, GXX, PARTS, PI, STRICT, checked, compiled, loop, needs_gcc, needs_gxx
from folders import ROOT
from piezotrack.errors import ParameterError
from piezotrack.export.library.calls import library_headers

HEADER = ROOT / "rust" / "capi" / "include"
RELEASE = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release"
LIBRARY = RELEASE / "libpiezotrack.so"
needs_library = pytest.mark.skipif(
    not LIBRARY.exists(), reason="the C library is not built: make c-library"
)
LINK = (f"-I{HEADER}", f"-L{RELEASE}", f"-Wl,-rpath,{RELEASE}")
SINE = pt.sine(frequency=0.5, low=5e-6, high=60e-6, duration=8.0)
PLAYS = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0, 20.0), weights=(5e-7, 2e-7))
PREISACH = pt.identify(pt.datasets.dbo_training()[3.0:13.0], "preisach")
NETWORK = pt.control.train_network(pt.datasets.dbo_training()[3.0:13.0], units=4)


def online(inverse: Any, **parts: Any) -> pt.Controller:
    return pt.Controller(dt=0.02, limits=(0.0, 75.0), feedforward=inverse, **parts)


# What has no form of its own in C, beside all that has one.
OTHERS = {
    "plays": online(PLAYS.inverse(), feedback=PI),
    "plays, lag and creep": online(
        pt.Inverse(
            stage=replace(PLAYS, time_constant=0.01, creep_weights=(0.02,), creep_times=(0.5,)),
            offset=1e-7,
            delay=0.004,
        ),
        feedback=pt.Pid(kp=1e5, ti=math.inf, td=0.001),
    ),
    "a stage that has moved": online(
        pt.Inverse(stage=PLAYS, initial=PLAYS.equilibrium([40.0, 10.0])), feedback=PI
    ),
    "Dahl": online(DAHL.inverse(), feedback=PI),
    "Preisach": pt.Controller.of(PREISACH, playback="online", feedback=PI),
    "network": pt.Controller(dt=0.005, limits=(0.0, 3.6), feedforward=NETWORK, feedback=PI),
    "scheduled PID": online(
        None,
        feedback=pt.control.ScheduledPid(
            amplitudes=(1e-6, 20e-6),
            rates=(0.1, 1.0),
            gains=[replace(PI, kp=PI.kp * (1.0 + 0.2 * i)) for i in range(4)],
        ),
    ),
    "Bouc-Wen observer": online(
        None,
        feedback=pt.control.HysteresisObserver(stage=pt.BoucWenStage.xu_li_2010(), pid=PI),
    ),
    "integral without tracking time": online(None, feedback=pt.Pid(kp=1e5, ti=0.02, td=0.0)),
}


def controller(name: str) -> pt.Controller:
    return OTHERS[name] if name in OTHERS else loop(name)


@needs_gcc
@needs_library
@pytest.mark.parametrize("name", [*PARTS, *OTHERS])
def test_the_library_gives_the_same_bits(name: str, tmp_path: Path) -> None:
    done = pt.control.export_controller(controller(name), tmp_path, to="library", name="axis")
    assert [path.name for path in done.files] == ["axis.h", "axis.c", "check.c", "vectors.csv"]
    assert str(done) == "calls libpiezotrack"
    compiled(tmp_path, "check.c", "axis.c", flags=(*STRICT, *LINK), libraries=("-lpiezotrack",))
    code, figures = checked(tmp_path)
    assert (code, figures["steps"]) == (0, 2000)
    assert figures["largest"] == 0.0
    assert figures["flags"] == 0


@needs_gcc
@needs_library
def test_the_tree_compiled_as_it_is_gives_the_same_bits(tmp_path: Path) -> None:
    """Without a word of Python between: the sources and the headers of what was chosen."""
    one, tree = controller("all"), Path(str(files("piezotrack.export.library"))) / "source"
    pt.control.export_controller(one, tmp_path, to="library", name="NAME")
    for ending in ("c", "h"):
        (tmp_path / f"NAME.{ending}").unlink()
    for header, text in library_headers(one).items():
        (tmp_path / header).write_text(text)
    places = (f"-I{tree}", f"-I{tmp_path}", str(tree / "NAME.c"))
    compiled(tmp_path, "check.c", flags=(*STRICT, *LINK, *places), libraries=("-lpiezotrack",))
    code, figures = checked(tmp_path)
    assert (code, figures["largest"], figures["flags"]) == (0, 0.0, 0)


@needs_gcc
@needs_library
def test_a_table_is_played(tmp_path: Path) -> None:
    export = pt.control.export_controller
    export(
        controller("plays"), tmp_path, to="library", name="axis", reference=SINE, beyond_reach=True
    )
    compiled(tmp_path, "check.c", "axis.c", flags=(*STRICT, *LINK), libraries=("-lpiezotrack",))
    code, figures = checked(tmp_path)
    assert (code, figures["largest"], figures["flags"]) == (0, 0.0, 0)


@needs_gcc
@needs_library
@pytest.mark.parametrize("linked", ["shared", "static"])
def test_the_example_learns(linked: str, tmp_path: Path) -> None:
    source = str(ROOT / "rust" / "capi" / "examples" / "track.c")
    libraries: tuple[str, ...] = ("-lpiezotrack", "-lm")
    if linked == "static":
        libraries = (str(RELEASE / "libpiezotrack.a"), "-lpthread", "-ldl", "-lm")
    compiled(tmp_path, source, flags=(*STRICT, *LINK), libraries=libraries)
    done = subprocess.run(
        ["./check"], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert pt.__version__ in done.stdout


CPLUSPLUS = """
#include "piezotrack.h"
int main()
{
    piezotrack_settings settings = {};
    char message[200];
    settings.dt = 0.001;
    settings.high = 75.0;
    const double numbers[] = {1e5, 0.02, 0.0};
    settings.law = {"pid", numbers, 3};
    piezotrack_controller *one = piezotrack_new(&settings, message, sizeof message);
    return one == nullptr && message[0] == 'l' ? 0 : 1;
}
"""


@needs_gxx
@needs_library
def test_the_header_is_for_cplusplus_too(tmp_path: Path) -> None:
    assert GXX is not None
    (tmp_path / "main.cpp").write_text(CPLUSPLUS)
    command = [GXX, "-std=c++11", "-Wall", "-Wextra", "-Werror", "-pedantic", "main.cpp"]
    done = subprocess.run(
        [*command, *LINK, "-lpiezotrack", "-o", "check"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert subprocess.run(["./check"], cwd=tmp_path, check=False, timeout=60).returncode == 0


# The library from another language, without a compiler.


class Numbers(ctypes.Structure):
    _fields_ = (
        ("name", ctypes.c_char_p),
        ("values", ctypes.POINTER(ctypes.c_double)),
        ("count", ctypes.c_size_t),
    )


class Settings(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_double) for name in ("dt", "low", "high")),
        *((name, ctypes.c_double) for name in ("span_low", "span_high", "max_jump")),
        ("law", Numbers),
        ("repetitive", Numbers),
        ("filters", ctypes.POINTER(Numbers)),
        ("filter_count", ctypes.c_size_t),
        ("model", ctypes.c_char_p),
        ("parameters", ctypes.POINTER(Numbers)),
        ("parameter_count", ctypes.c_size_t),
        ("initial", ctypes.POINTER(Numbers)),
        ("initial_count", ctypes.c_size_t),
        ("offset", ctypes.c_double),
        ("delay", ctypes.c_double),
    )


def numbers(name: str | None, *values: float) -> Numbers:
    array = (ctypes.c_double * len(values))(*values)
    pointer = ctypes.cast(array, ctypes.POINTER(ctypes.c_double))
    return Numbers(None if name is None else name.encode(), pointer, len(values))


@pytest.fixture(scope="module")
def library() -> ctypes.CDLL:
    compiled = ctypes.CDLL(str(LIBRARY))
    compiled.piezotrack_new.restype = ctypes.c_void_p
    compiled.piezotrack_step.restype = ctypes.c_double
    compiled.piezotrack_step.argtypes = (ctypes.c_void_p, *[ctypes.c_double] * 3)
    compiled.piezotrack_start.restype = compiled.piezotrack_applied.restype = ctypes.c_bool
    compiled.piezotrack_start.argtypes = (ctypes.c_void_p, ctypes.c_double)
    compiled.piezotrack_applied.argtypes = (ctypes.c_void_p, ctypes.c_double)
    compiled.piezotrack_reset.argtypes = compiled.piezotrack_free.argtypes = (ctypes.c_void_p,)
    return compiled


def pid_settings(**other: Any) -> Settings:
    known = {"dt": 0.02, "high": 75.0, "law": numbers("pid", 1e5, 0.02, 0.0, math.nan)}
    return Settings(**(known | other))


PLAYS_LISTS = (Numbers * len(PLAYS._named))(*(numbers(name, *v) for name, v in PLAYS._named))
PLAYS_GIVEN = {
    "model": b"prandtl-ishlinskii",
    "parameters": PLAYS_LISTS,
    "parameter_count": len(PLAYS_LISTS),
}
REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "no interval": ({"dt": 0.0}, "dt is 0 s: expected"),
    "interval is NaN": ({"dt": math.nan}, "dt is NaN s: expected"),
    "limits the other way round": ({"low": 80.0}, "high"),
    "limits whose sums overflow": (
        {"low": -8e307, "high": 8e307},
        "low is -8e307 V: expected a voltage",
    ),
    "an offset of no model": ({"offset": 1e-6}, "offset is 1e-6 m: expected 0, as model is NULL"),
    "a delay of no model": ({"delay": math.nan}, "delay is NaN s: expected 0, as model is NULL"),
    "span the other way round": (
        {"span_low": 1e-6, "span_high": -1e-6},
        "span is -1e-6 m: expected an upper end",
    ),
    "span in um": ({"span_low": 0.0, "span_high": 80.0}, "span is 80 m: expected a displacement"),
    "no such law": (
        {"law": numbers("pdi", 1.0)},
        "law is 'pdi': expected 'pid', 'state-space', 'lead-lag'",
    ),
    "too few numbers": (
        {"law": numbers("pid", 1.0, 2.0)},
        "law is 'pid' with 2 numbers: expected kp in V/m",
    ),
    "a state too many": (
        {"law": numbers("state-space", 1e300, 1.0)},
        "state-space, n is 1e300: expected a whole number from 1 on",
    ),
    "numbers without a name": (
        {"law": numbers(None, 1.0)},
        "law.name is NULL: expected a name, as there are 1 values",
    ),
    "a part of a state": (
        {"law": numbers("state-space", 1.5, 1.0)},
        "state-space, n is 1.5: expected a whole number from 1 on",
    ),
    "no truth value": (
        {"repetitive": numbers("lag", 1.0, 3e5, 0.1, 0.99, 0.0, 7.0)},
        "pause is 7.0: expected 0 or 1",
    ),
    "a lead without end": (
        {"repetitive": numbers("lag", 1.0, 3e5, 0.1, 0.99, 1e18, 1.0)},
        "lead is 1e18: expected a whole number from 0 on",
    ),
    "a grid without numbers": (
        {"law": numbers("scheduled-pid", 2.0)},
        "law is 'scheduled-pid' with 1 numbers: expected two counts",
    ),
    "a name that moves the cursor": (
        {"law": numbers("p\x1b[2Jid", 1.0)},
        "law.name is no text: expected a name in UTF-8, without control characters",
    ),
    "numbers that are not there": ({"law": Numbers(b"pid", None, 4)}, "law.values is NULL"),
    "a name that is no text": (
        {"model": b"\xff\xfe"},
        "model is no text: expected a name in UTF-8",
    ),
    "no such smoothing": (
        {"repetitive": numbers("box", 1.0, 1e5, 1.0, 0.99, 0.0, 1.0)},
        "smoothing is 'box': expected 'lag'",
    ),
    "no such model": ({"model": b"dhal"}, "model is 'dhal': expected"),
    "a parameter is missing": ({"model": b"dahl"}, "missing: expected a value"),
    "filters that are not there": ({"filter_count": 2}, "filters is NULL: expected 2 elements"),
}


@needs_library
@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_refused_in_a_sentence(library: ctypes.CDLL, case: str) -> None:
    other, expected = REFUSED[case]
    message = ctypes.create_string_buffer(600)
    made = library.piezotrack_new(ctypes.byref(pid_settings(**other)), message, 600)
    assert not made
    assert expected in message.value.decode()
    assert len(message.value) < 600
    # Room for five bytes, then for none.
    short = ctypes.create_string_buffer(b"x" * 8, 8)
    library.piezotrack_new(ctypes.byref(pid_settings(**other)), short, 5)
    assert short.raw[:5] == message.raw[:4] + b"\0"
    assert short.raw[5:] == b"xxx"
    assert not library.piezotrack_new(ctypes.byref(pid_settings(**other)), None, 0)


@needs_library
@pytest.mark.parametrize("name", ["dt", "low", "high", "offset", "delay"])
def test_the_library_refuses_what_python_refuses(library: ctypes.CDLL, name: str) -> None:
    for size in (0.0, 1e-300, 1e-15, 1e-3, 1.0, 1e9, 1e12, 1e99, 1e150, 9e307, math.inf, math.nan):
        for value in (size, -size):
            given = {"dt": 0.02, "low": -1.0, "high": 75.0, "offset": 0.0, "delay": 0.0}
            given[name] = value
            settings = pid_settings(**given, **PLAYS_GIVEN)
            settings.law = Numbers()
            made = library.piezotrack_new(ctypes.byref(settings), None, 0)
            library.piezotrack_free(made)
            try:
                inverse = pt.Inverse(stage=PLAYS, offset=given["offset"], delay=given["delay"])
                limits = (given["low"], given["high"])
                pt.Controller(dt=given["dt"], limits=limits, feedforward=inverse).start()
            except pt.PiezotrackError:
                assert not made, value
            else:
                assert made, value


@needs_library
def test_null_is_harmless(library: ctypes.CDLL) -> None:
    message = ctypes.create_string_buffer(200)
    assert not library.piezotrack_new(None, message, 200)
    assert message.value == b"settings is NULL: expected a piezotrack_settings"
    assert math.isnan(library.piezotrack_step(None, 0.0, 0.0, 0.0))
    assert library.piezotrack_start(None, 0.0) is False
    assert library.piezotrack_applied(None, 0.0) is False
    library.piezotrack_reset(None)
    library.piezotrack_free(None)


@needs_library
def test_a_start_at_the_voltage_that_is_there_has_no_bump(library: ctypes.CDLL) -> None:
    settings = pid_settings()
    axis = library.piezotrack_new(ctypes.byref(settings), None, 0)
    assert library.piezotrack_start(axis, 90.0) is False
    assert library.piezotrack_start(axis, 40.0) is True
    assert library.piezotrack_applied(axis, math.nan) is False
    session = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid(kp=1e5, ti=0.02)).start(
        present=40.0
    )
    for k in range(50):
        measured = 20e-6 + 1e-8 * math.sin(k)
        out = library.piezotrack_step(axis, 20e-6, math.nan, measured)
        assert out == session.step(20e-6, measured)
    assert abs(out - 40.0) < 1.0
    library.piezotrack_free(axis)


@pytest.mark.parametrize("to", ["library"])
def test_the_library_has_doubles_only(to: Any, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="single is True with to='library': expected False"):
        pt.control.export_controller(loop("PID"), tmp_path, to=to, single=True)
