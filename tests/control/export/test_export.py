"""Controllers in C: compiled, they give the bits of the Rust controller."""

from __future__ import annotations

import csv
import json
import math
import re
import subprocess
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from c_exports import (
    DAHL,
    GXX,
    PARTS,
    PI,
    checked,
    compiled,
    loop,
    needs_gcc,
    needs_gxx,
)
from folders import ROOT
from piezotrack.errors import ParameterError
from piezotrack.export.vectors import rows_of

if TYPE_CHECKING:
    from pathlib import Path

export = pt.control.export_controller
PLAYS = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(5e-7,))
SINE = pt.sine(frequency=0.5, low=5e-6, high=60e-6, duration=8.0)


@needs_gcc
@pytest.mark.parametrize("name", PARTS)
def test_doubles_give_the_bits_of_rust(name: str, tmp_path: Path) -> None:
    done = export(loop(name), tmp_path, name="axis")
    compiled(tmp_path, "check.c", "axis.c")
    code, figures = checked(tmp_path)
    assert code == 0
    assert figures["steps"] == 2000
    assert figures["largest"] == 0.0
    assert figures["flags"] == 0
    assert figures["state"] == done.state_bytes
    # No library: the only headers are those of integers and truth values.
    source = (tmp_path / "axis.c").read_text() + (tmp_path / "axis.h").read_text()
    assert set(re.findall(r"#include [<\"](.*)[>\"]", source)) == {
        *("axis.h", "stdint.h", "stdbool.h")
    }
    assert "@" not in source
    assert "NAME" not in source


@needs_gcc
@pytest.mark.parametrize("inverse", [PLAYS.inverse(), DAHL.inverse()], ids=["plays", "Dahl"])
@pytest.mark.parametrize("law", [PI, PARTS["Dahl with damping"]["feedback"]], ids=["PI", "damped"])
def test_a_table_is_played(law: Any, inverse: pt.Inverse, tmp_path: Path) -> None:
    one = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedforward=inverse, feedback=law)
    export(one, tmp_path, name="axis", reference=SINE)
    compiled(tmp_path, "check.c", "axis.c")
    code, figures = checked(tmp_path)
    assert (code, figures["largest"]) == (0, 0.0)
    with (tmp_path / "vectors.csv").open() as file:
        rows = list(csv.DictReader(file))
    table = inverse.table(SINE, 0.02, limits=(0.0, 75.0))
    assert [float(row["feedforward_V"]) for row in rows[:250]] == [
        *table,
        *table,
        *table[:50],
    ]


def test_the_vectors_have_what_can_go_wrong() -> None:
    rows = rows_of(loop("repetitive"))
    assert sum(row.saturated for row in rows) > 100
    assert sum(math.isnan(row.measured) for row in rows) > 5
    assert sum(not row.measurement_ok for row in rows) > sum(
        math.isnan(row.measured) for row in rows
    )
    assert sum(not row.reference_ok for row in rows) >= 4
    assert sum(row.reset for row in rows) == 1
    assert sum(math.isfinite(row.applied) for row in rows) > 30
    # Of period 250: what was learnt comes back more than once.
    assert any(row.repetitive != 0.0 for row in rows[250:500])
    assert len(rows) == 2000


@needs_gcc
def test_the_commands_of_the_page_do_what_it_says(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "export.md").read_text(encoding="utf-8")
    compiling = next(line for line in page.splitlines() if line.startswith("cc "))
    export(loop("all"), tmp_path, name="axis")
    done = subprocess.run(
        f"{compiling} && ./check vectors.csv",
        shell=True,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    assert "largest difference 0 at step 0, flags that differ 0" in done.stdout


@needs_gcc
def test_a_changed_constant_is_found(tmp_path: Path) -> None:
    export(loop("PID"), tmp_path, name="axis")
    source = (tmp_path / "axis.c").read_text()
    changed = source.replace("PID_PROPORTIONAL * rise", "PID_PROPORTIONAL * 1.000000001 * rise")
    assert changed != source
    (tmp_path / "axis.c").write_text(changed)
    compiled(tmp_path, "check.c", "axis.c")
    code, figures = checked(tmp_path)
    assert code == 1
    assert figures["largest"] > 0.0


@needs_gcc
def test_fast_mathematics_is_refused_by_the_compiler(tmp_path: Path) -> None:
    export(loop("PID"), tmp_path, name="axis")
    with pytest.raises(AssertionError, match="compile without -ffast-math"):
        compiled(tmp_path, "check.c", "axis.c", flags=("-std=c99", "-ffast-math"))


ROOTS = """
#include <math.h>
#include <stdio.h>
#include "axis.c"
int main(void)
{
    uint64_t seed = 1;
    long i, wrong = 0;
    for (i = 0; i < 300000; i++) {
        union { double value; uint64_t bits; } x;
        double mine, right;
        seed = seed * 6364136223846793005u + 1442695040888963407u;
        x.bits = (seed ^ (seed >> 29)) & 0x7fffffffffffffffu;
        if (i < 3) x.bits = (uint64_t)i;
        if (x.value != x.value) continue;
        mine = square_root(x.value);
        right = sqrt(x.value);
        wrong += mine != right;
    }
    wrong += square_root(-1.0) == square_root(-1.0);
    printf("wrong %ld, of %ld\\n", wrong, i);
    return wrong != 0;
}
"""


@needs_gcc
def test_the_square_root_is_rounded_as_that_of_the_library(tmp_path: Path) -> None:
    export(loop("Dahl"), tmp_path, name="axis")
    (tmp_path / "roots.c").write_text(ROOTS)
    compiled(tmp_path, "roots.c", "-lm", flags=("-std=c99",))
    code, figures = checked(tmp_path)
    assert (code, figures["wrong"]) == (0, 0.0)


@needs_gcc
def test_a_bumpless_start_is_that_of_rust(tmp_path: Path) -> None:
    laws = ("PID", "sliding mode", "state space", "perturbation", "hysteresis observer")
    for name in (*laws, "positive position feedback"):
        controller = loop(name)
        export(controller, tmp_path, name="axis")
        program = """#include <stdio.h>
        #include <stdlib.h>
        #include "axis.h"
        int main(void) {
            axis_state s;
            int k;
            if (axis_start(&s, -1.0) || !axis_start(&s, 33.0)) return 1;
            if (axis_applied(&s, strtod("nan", 0))) return 1;
            for (k = 0; k < 20; k++) printf("%a ", axis_step(&s, 5e-5, 4e-5 + 1e-7 * k, 1.0));
            return 0;
        }"""
        (tmp_path / "start.c").write_text(program)
        compiled(tmp_path, "start.c", "axis.c")
        done = subprocess.run(["./check"], cwd=tmp_path, capture_output=True, text=True, check=True)
        session = controller.start(present=33.0)
        rust = [session.step(5e-5, 4e-5 + 1e-7 * k, feedforward=1.0) for k in range(20)]
        assert [float.fromhex(word) for word in done.stdout.split()] == rust, name


# A number that counts what is done with it.
COUNTED = """
struct counted {
    double v;
    static long adds, muls, divs;
    counted() = default;
    counted(double x) : v(x) {}
    explicit operator double() const { return v; }
};
inline counted operator+(counted a, counted b) { counted::adds++; return a.v + b.v; }
inline counted operator-(counted a, counted b) { counted::adds++; return a.v - b.v; }
inline counted operator*(counted a, counted b) { counted::muls++; return a.v * b.v; }
inline counted operator/(counted a, counted b) { counted::divs++; return a.v / b.v; }
inline counted operator-(counted a) { return -a.v; }
inline counted &operator+=(counted &a, counted b) { return a = a + b; }
inline counted &operator-=(counted &a, counted b) { return a = a - b; }
inline counted &operator*=(counted &a, counted b) { return a = a * b; }
#define COMPARED(op) inline bool operator op(counted a, counted b) { return a.v op b.v; }
COMPARED(<) COMPARED(>) COMPARED(<=) COMPARED(>=) COMPARED(==) COMPARED(!=)
"""
COUNTING = """
#include <cstdio>
#define volatile
#include "axis.c"
long counted::adds, counted::muls, counted::divs;
int main()
{
    static axis_state s;
    axis_init(&s);
    for (int k = 0; k < 40; k++) {
        counted::adds = counted::muls = counted::divs = 0;
        axis_step(&s, 5e-5 + 1e-9 * k, @next 5e-5 + 1e-9 * k - 1e-10 @last);
    }
    std::printf("adds %ld, muls %ld, divs %ld\\n", counted::adds, counted::muls, counted::divs);
    return s.last.saturated;
}
"""


@needs_gxx
@pytest.mark.parametrize("name", [one for one in PARTS if not one.startswith(("Dahl", "all"))])
def test_the_operations_are_those_that_are_printed(name: str, tmp_path: Path) -> None:
    """The same source as C++, with numbers that count; the tests of numbers are not counted."""
    done = export(loop(name), tmp_path, name="axis")
    header = (
        (tmp_path / "axis.h")
        .read_text()
        .replace(
            "typedef double axis_real;", f'}}{COUNTED}\ntypedef counted axis_real;\nextern "C" {{'
        )
    )
    (tmp_path / "axis.h").write_text(header)
    source = (tmp_path / "axis.c").read_text()
    # is_finite subtracts once for each number that it looks at: a test, no operation of the step.
    plain = "const real nothing = value.v - value.v;"
    (tmp_path / "axis.c").write_text(source.replace("const real nothing = value - value;", plain))
    (tmp_path / "count.cpp").write_text(COUNTING.replace("@next", "").replace("@last", ", 30.0"))
    assert GXX is not None
    command = [GXX, "-std=c++17", "-w", "-fpermissive", "-o", "check", "count.cpp"]
    built = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr[:2000]
    _, figures = checked(tmp_path)
    assert done.additions is not None
    # The dot products of a loop add to 0 first, as those of Rust do.
    assert (figures["adds"], figures["muls"], figures["divs"]) == (
        done.additions,
        done.multiplications,
        done.divisions,
    )


def test_constants_are_exact(tmp_path: Path) -> None:
    export(loop("PID"), tmp_path, name="axis")
    matches = re.findall(
        r"(-?0x[0-9a-f.]+p[+-]\d+)[,;] /\* (\S+) \*/", (tmp_path / "axis.c").read_text()
    )
    assert len(matches) > 8
    for exact, decimal in matches:
        assert float.fromhex(exact) == float(decimal)
    export(loop("PID"), tmp_path, name="axis", single=True)
    matches = re.findall(
        r"(-?0x[0-9a-f.]+p[+-]\d+)f[,;] /\* (\S+) \*/", (tmp_path / "axis.c").read_text()
    )
    for exact, decimal in matches:
        assert float.fromhex(exact) == float(np.float32(float(decimal)))


# What has no form in C.

NO_FORM: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "scheduled": (
        {"feedback": pt.control.ScheduledPid(amplitudes=[1e-5], rates=[1.0], gains=[PI])},
        {},
        "feedback is a scheduled PID, which has no form in C",
    ),
    "Bouc-Wen": (
        {
            "feedback": pt.control.HysteresisObserver(
                stage=pt.BoucWenStage.xu_li_2010_corrected(), pid=PI
            )
        },
        {},
        "hysteresis observer of a Bouc-Wen stage, which has no form in C",
    ),
    "plays": ({"feedforward": PLAYS.inverse()}, {}, "feedforward is the inverse of a Prandtl"),
    "reference": ({}, {"reference": SINE}, "the controller has no feedforward"),
    "period": (
        {"feedforward": PLAYS.inverse()},
        {"reference": pt.sine(frequency=0.3, low=0.0, high=5e-5, duration=4.0)},
        "has a period of 3.33333 s: expected a whole number of samples of 0.02 s",
    ),
    "repetitive": (
        {"feedforward": PLAYS.inverse(), "repetitive": PARTS["repetitive"]["repetitive"]},
        {"reference": SINE},
        "repetitive has a period of 5 s: expected that of the reference",
    ),
    "multisine": (
        {"feedforward": PLAYS.inverse()},
        {"reference": pt.multisine(frequencies=[0.5, 1.3], low=0.0, high=5e-5, duration=4.0)},
        "does not repeat: expected one that does",
    ),
    "name": ({}, {"name": "1axis"}, "name is '1axis': expected a letter"),
    "name inside": ({}, {"name": "pid"}, "name is 'pid', as functions inside"),
    "name of the harness": ({}, {"name": "check"}, "name is 'check', as a file or function beside"),
    "name of the library": ({}, {"name": "piezotrack"}, "name is 'piezotrack', as a file or"),
    "form": ({}, {"to": "cobol"}, "to is 'cobol': expected 'c99', 'firmware', 'library'"),
    "float": (
        {"feedback": pt.control.StateSpace([[1e60]], [1.0], [1.0])},
        {"single": True},
        "LAW_A is 1e+60: expected a number that a float can have",
    ),
    "float in JSON": ({}, {"to": "json", "single": True}, "single is True with to='json'"),
    "motion": ({}, {"reference": 3}, "reference is 3: expected a Reference"),
    "table and motion": (
        {"feedforward": PLAYS.inverse()},
        {"reference": SINE, "table": [1.0]},
        "reference is given beside table: expected one of them",
    ),
    "period of a table": (
        {"repetitive": PARTS["repetitive"]["repetitive"]},
        {"table": np.zeros(100)},
        "repetitive has a period of 5 s: expected that of the table, 2 s, or a multiple",
    ),
}
# What is no table, and the sentence.
NO_TABLE: dict[str, tuple[Any, str]] = {
    "beyond the limits": ([0.0, 80.0], "table[1] is 80 V: expected voltages within the limits, 0"),
    "not finite": ([0.0, math.nan], "table is nan at sample 1: expected finite numbers"),
    "empty": ([], "table has 0 samples: expected 1 to"),
    "rows": ([[0.0, 1.0]], "table has the shape (1, 2): expected one dimension"),
}


@pytest.mark.parametrize("name", NO_TABLE)
def test_what_is_no_table_is_refused(name: str, tmp_path: Path) -> None:
    table, sentence = NO_TABLE[name]
    with pytest.raises(pt.PiezotrackError, match=re.escape(sentence)):
        export(loop("PID"), tmp_path / "out", table=table)
    assert not (tmp_path / "out").exists()


@needs_gcc
@pytest.mark.parametrize("forward", ["none", "plays"])
def test_a_learnt_table_is_played(forward: str, tmp_path: Path) -> None:
    """What was learnt between trials, with a feedback around it."""
    parts: dict[str, Any] = {} if forward == "none" else {"feedforward": PLAYS.inverse()}
    one = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=PI, **parts)
    table = 20.0 + 15.0 * np.sin(2.0 * np.pi * np.arange(100) / 100.0)
    export(one, tmp_path, name="axis", table=table)
    compiled(tmp_path, "check.c", "axis.c")
    code, figures = checked(tmp_path)
    assert (code, figures["steps"], figures["largest"]) == (0, 2000, 0.0)
    with (tmp_path / "vectors.csv").open() as file:
        given = [float(row["feedforward_V"]) for row in csv.DictReader(file)]
    assert given == [*table] * 20


@pytest.mark.parametrize("name", NO_FORM)
def test_what_has_no_form_is_refused(name: str, tmp_path: Path) -> None:
    parts, options, sentence = NO_FORM[name]
    one = pt.Controller(dt=0.02, limits=(0.0, 75.0), **parts)
    with pytest.raises(ParameterError) as raised:
        export(one, tmp_path / "out", **options)
    assert sentence in str(raised.value)
    assert not (tmp_path / "out").exists()


# Coefficients.


def test_coefficients_without_their_feedforward_say_so(tmp_path: Path) -> None:
    controller = pt.Controller(
        dt=0.02, limits=(0.0, 75.0), feedforward=PLAYS.inverse(), feedback=PI
    )
    said = str(export(controller, tmp_path, to="json"))
    assert said.startswith("coefficients; without the feedforward")
    assert str(export(controller, tmp_path, to="json", reference=SINE)) == "coefficients"


def test_the_biquads_and_matrices_are_those_of_the_step(tmp_path: Path) -> None:
    """A step of one's own from the coefficients follows the controller, unsaturated."""
    controller = pt.Controller(
        dt=0.02, limits=(-1e3, 1e3), feedback=pt.Pid.xu_li_2010(), filters=[pt.Notch(10.0)]
    )
    (path,) = export(controller, tmp_path, to="json", name="axis").files
    document = json.loads(path.read_text())
    assert path.name == "axis.json"
    session = controller.start()
    rng = np.random.default_rng(1)
    readings = 1e-6 * rng.standard_normal(60)
    volts = [session.step(0.0, float(y)) for y in readings]
    (notch,), pid = document["filters"], document["feedback"]
    # Both begin in the steady state of the first sample: from there on, the differences.
    filtered = filtered_by(notch, readings - readings[0]) + readings[0]
    error = -filtered
    proportional = filtered_by(pid, error - error[0])
    steady = volts[0] + pid["b"][0] * 0.0
    integral = sum(pid["b"])
    assert np.allclose(
        volts, proportional + steady + integral * error[0] * np.arange(60), rtol=0, atol=1e-12
    )
    law = pt.control.LeadLag(kp=1e5, lead=0.05, lag=0.3)
    (path,) = export(
        pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=law), tmp_path, to="json"
    ).files
    found = json.loads(path.read_text())["feedback"]
    static = found["c"][0] * found["b"][0] / (1.0 - found["a"][0][0]) + found["d_V_per_m"]
    assert static == pytest.approx(1e5)


def filtered_by(one: dict[str, Any], x: Any) -> Any:
    y = np.zeros(x.size)
    (b0, b1, b2), (_, a1, a2) = one["b"], one["a"]
    for k in range(x.size):
        past = [x[k - 1] if k > 0 else 0.0, x[k - 2] if k > 1 else 0.0]
        fed = [y[k - 1] if k > 0 else 0.0, y[k - 2] if k > 1 else 0.0]
        y[k] = b0 * x[k] + b1 * past[0] + b2 * past[1] - a1 * fed[0] - a2 * fed[1]
    return y
