"""Settings of an export: changed while it runs, it gives the bits of a session that is retuned."""

from __future__ import annotations

import math
import re
import struct
import subprocess
import zlib
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from c_exports import PARTS, PI, SLIDING, STRICT, checked, compiled, learner, loop, needs_gcc
from piezotrack.errors import ParameterError

if TYPE_CHECKING:
    from pathlib import Path

export = pt.control.export_controller
settings_of = pt.control.settings_of
GAINS = pt.Pid.from_um(kp=0.03, ti=0.05, td=0.01)
# Other numbers for the parts of a controller: each of them is gone to, and back.
OTHERS: dict[str, list[dict[str, Any]]] = {
    "PID": [{"feedback": GAINS}, {"feedback": pt.Pid(kp=-2e5, ti=math.inf)}],
    "PD": [{"feedback": GAINS}],
    "filters and jumps": [
        {"feedback": GAINS},
        {"filters": [pt.LowPass(5.0), pt.Notch(12.0)]},
        {"filters": [pt.LowPass(3.0), pt.Notch(15.0)], "feedback": GAINS},
    ],
    "state space": [
        {"feedback": pt.control.StateSpace([[0.8, 0.1], [0.2, 0.9]], [2e3, 1e3], [0.5, 2.0], 3e4)}
    ],
    "lead-lag": [{"feedback": pt.control.LeadLag(kp=2e5, lead=0.1, lag=0.5)}],
    "sliding mode": [
        {"feedback": replace(SLIDING, layer=5e-6)},
        {"feedback": pt.control.SlidingMode(switching=2.0, layer=20e-6, td=0.01, tf=0.03)},
    ],
    "disturbance observer": [
        {"feedback": replace(PARTS["disturbance observer"]["feedback"], pid=GAINS)},
        {"feedback": replace(PARTS["disturbance observer"]["feedback"], cutoff=2.0)},
    ],
    "perturbation": [
        {"feedback": replace(PARTS["perturbation"]["feedback"], cutoff=0.5)},
        {
            "feedback": replace(
                PARTS["perturbation"]["feedback"], sliding=replace(SLIDING, switching=4.0)
            )
        },
    ],
    "hysteresis observer": [
        {"feedback": replace(PARTS["hysteresis observer"]["feedback"], pid=GAINS)},
        {"feedback": replace(PARTS["hysteresis observer"]["feedback"], correction=0.4)},
    ],
    "positive position feedback": [
        {"feedback": replace(PARTS["positive position feedback"]["feedback"], pid=GAINS)},
        {"feedback": replace(PARTS["positive position feedback"]["feedback"], gain=0.1e6)},
        {"filters": [pt.LowPass(15.0)]},
    ],
    "repetitive": [
        {"feedback": GAINS},
        {"repetitive": learner(period=5.0, kq=0.5, tq=0.05)},
    ],
    "repetitive, part of a sample": [
        {
            "repetitive": learner(
                period=2.507, kq=0.2, smoothing=pt.control.ZeroPhase(order=3), lead=2
            )
        }
    ],
    "repetitive alone": [{"repetitive": learner(period=0.2, kq=0.9, smoothing=None)}],
    "Dahl": [{"feedback": GAINS}],
    "all": [
        {"feedback": GAINS, "filters": [pt.LowPass(10.0)]},
        {"repetitive": learner(period=5.0, kq=0.1, tq=0.05)},
    ],
}
STEPS = 1500

# A line of the file: what is done (0 a step, 1 a report, 2 a reset, 3 other settings), its numbers.
REPLAY = """
#include <stdio.h>
#include <stdlib.h>
#include "axis.h"
int main(void)
{
    static axis_state s;
    static axis_settings other;
    FILE *file = fopen("script.txt", "r");
    int what, i;
    double in[3];
    if (file == NULL) return 2;
    axis_init(&s);
    while (fscanf(file, "%d", &what) == 1) {
        if (what == 3) {
            axis_settings_default(&other);
            for (i = 0; i < AXIS_SETTINGS; i++) {
                char word[64];
                if (fscanf(file, "%63s", word) != 1) return 3;
                other.value[i] = strtod(word, NULL);
            }
            axis_settings_seal(&other);
            if (!axis_retune(&s, &other)) return 4;
            continue;
        }
        for (i = 0; i < 3; i++) {
            char word[64];
            if (fscanf(file, "%63s", word) != 1) return 3;
            in[i] = strtod(word, NULL);
        }
        if (what == 1) axis_applied(&s, in[0]);
        else if (what == 2) axis_reset(&s);
        else {
            axis_step(&s, in[0], in[1], in[2]);
            printf("%a %a %a %a %a\\n", s.last.volts, s.last.unclipped, s.last.feedback,
                   s.last.repetitive, s.last.error);
        }
    }
    return 0;
}
"""


def replayed(name: str) -> tuple[str, list[list[float]]]:
    """A run in Python with saturation, bad readings, reports, a reset; its script for C."""
    first = loop(name)
    others = [replace(first, **parts) for parts in OTHERS[name]]
    online = first.feedforward is not None
    rng = np.random.default_rng(7)
    session, x = first.start(), 5e-5
    lines: list[str] = []
    found: list[list[float]] = []

    def retuned(to: pt.Controller) -> None:
        session.retune(to)
        numbers = list(settings_of(to, like=first).values())
        lines.append(" ".join(["3", *(number.hex() for number in numbers)]))

    retuned(others[0])
    retuned(first)
    for k in range(STEPS):
        if k % 37 == 11:
            retuned([first, *others][int(rng.integers(len(others) + 1))])
        if k == 900:
            session.reset()
            lines.append("2 0 0 0")
        desired = 5e-5 + 4e-5 * math.sin(0.05 * k) * (2.0 if 300 < k < 600 else 1.0)
        desired = max(desired, -1e-5)
        measured = x + 1e-8 * float(rng.standard_normal()) if k % 83 else math.nan
        third = desired + 2e-6 * math.cos(0.05 * k) if online else 5.0 + 3.0 * math.sin(0.02 * k)
        given = {"preview": third} if online else {"feedforward": third}
        out = session.step(desired, measured, **given)
        inputs = (desired, third, measured) if online else (desired, measured, third)
        lines.append(" ".join(["0", *(one.hex() for one in inputs)]))
        last = session.last
        found.append([out, last.unclipped, last.feedback, last.repetitive, last.error])
        if k % 41 == 3:
            report = 0.9 * out
            session.applied(report)
            lines.append(f"1 {report.hex()} 0 0")
        x += 0.3 * (1.5e-6 * out - x)
    return "\n".join(lines) + "\n", found


@needs_gcc
@pytest.mark.parametrize("name", OTHERS)
def test_a_retuned_export_gives_the_bits_of_a_retuned_session(name: str, tmp_path: Path) -> None:
    script, expected = replayed(name)
    assert script.count("\n3 ") > 30
    export(loop(name), tmp_path, name="axis")
    (tmp_path / "script.txt").write_text(script)
    (tmp_path / "replay.c").write_text(REPLAY)
    compiled(tmp_path, "replay.c", "axis.c")
    done = subprocess.run(["./check"], cwd=tmp_path, capture_output=True, text=True, check=True)
    found = [[float.fromhex(word) for word in line.split()] for line in done.stdout.splitlines()]
    assert len(found) == STEPS
    assert found == expected
    # The numbers that were changed matter: without them other commands come out.
    without = "\n".join(line for line in script.splitlines() if not line.startswith("3 "))
    (tmp_path / "script.txt").write_text(without)
    done = subprocess.run(["./check"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert [float.fromhex(line.split()[0]) for line in done.stdout.splitlines()] != [
        row[0] for row in expected
    ]


REFUSED = """
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "axis.h"
static axis_state s, before;
static axis_settings image;
static int refused(void)
{
    before = s;
    return !axis_retune(&s, &image) && memcmp(&s, &before, sizeof s) == 0;
}
int main(void)
{
    int i, wrong = 0, all = 0;
    axis_init(&s);
    axis_step(&s, 5e-5f, 4e-5f, 0);
    image = s.settings;
    wrong += !axis_retune(&s, &image);
#define REFUSED(change) \\
    axis_settings_default(&image); change; all++; wrong += !refused();
    REFUSED(image.version++)
    REFUSED(image.version++; image.checksum++)
    REFUSED(image.layout ^= 1u)
    REFUSED(image.checksum ^= 0x80000000u)
    REFUSED(image.value[0] *= 2)
    for (i = 0; i < AXIS_SETTINGS; i++) {
        const axis_setting *one = &axis_setting_list[i];
        REFUSED(image.value[i] = (axis_real)strtod("nan", 0); axis_settings_seal(&image))
        REFUSED(image.value[i] = (axis_real)strtod("inf", 0); axis_settings_seal(&image))
        REFUSED(image.value[i] = one->high + (one->high - one->low) / 1000;
                axis_settings_seal(&image))
        REFUSED(image.value[i] = one->low - (one->high - one->low) / 1000;
                axis_settings_seal(&image))
        axis_settings_default(&image);
        image.value[i] = one->high;
        axis_settings_seal(&image);
        wrong += !axis_retune(&s, &image);
    }
    axis_settings_default(&image);
    printf("wrong %d, of %d, layout %lu, checksum %lu, version %lu", wrong, all,
           (unsigned long)image.layout, (unsigned long)image.checksum,
           (unsigned long)image.version);
    for (i = 0; i < AXIS_SETTINGS; i++) printf(", %s %.17g", axis_setting_list[i].name,
                                               (double)image.value[i]);
    return wrong != 0;
}
"""


@needs_gcc
@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
@pytest.mark.parametrize("name", ["PID", "filters and jumps", "lead-lag", "hysteresis observer"])
def test_what_is_not_whole_or_out_of_range_changes_nothing(
    name: str, single: bool, tmp_path: Path
) -> None:
    done = export(loop(name), tmp_path, name="axis", single=single)
    (tmp_path / "refused.c").write_text(REFUSED)
    compiled(tmp_path, "refused.c", "axis.c")
    run = subprocess.run(["./check"], cwd=tmp_path, capture_output=True, text=True, check=False)
    words = dict(part.rsplit(" ", 1) for part in run.stdout.split(", "))
    count = len(words) - 5
    assert (run.returncode, words["wrong"], words["of"]) == (0, "0", str(5 + 4 * count))
    # The numbers are those that a program gets from Python, under their names.
    numbers = list(settings_of(loop(name), single=single).values())
    assert [float(word) for word in list(words.values())[5:]] == numbers
    # The checksum is that of zlib over version, layout and numbers.
    packed = struct.pack(f"<II{count}{'f' if single else 'd'}", 1, int(words["layout"]), *numbers)
    assert int(words["checksum"]) == zlib.crc32(packed)
    compiled(tmp_path, "check.c", "axis.c")
    assert checked(tmp_path)[1]["state"] == done.state_bytes


STILL = """
#include <stdio.h>
#include "axis.h"
int main(void)
{
    static axis_state s;
    static axis_settings other;
    double before, after, kept;
    int k;
    axis_start(&s, 30.0);
    for (k = 0; k < 50; k++) axis_step(&s, 5e-5, 5e-5, 1.0);
    before = s.last.volts;
    axis_settings_default(&other);
    other.value[@place] *= 1.5;
    axis_settings_seal(&other);
    if (!axis_retune(&s, &other)) return 1;
    after = axis_step(&s, 5e-5, 5e-5, 1.0);
    axis_reset(&s);
    kept = s.settings.value[@place] / other.value[@place];
    axis_init(&s);
    printf("before %.17g, after %.17g, kept %.17g, default %.17g", before, after, kept,
           s.settings.value[@place] * 1.5 / other.value[@place]);
    return 0;
}
"""


@needs_gcc
@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("PID", 0),
        ("filters and jumps", 10),
        ("state space", 8),
        ("lead-lag", 2),
        ("sliding mode", 1),
    ],
)
def test_other_settings_make_no_bump_at_rest(name: str, place: int, tmp_path: Path) -> None:
    """At rest the command stays what it is; a reset keeps the settings, a begin does not."""
    export(loop(name), tmp_path, name="axis")
    (tmp_path / "still.c").write_text(STILL.replace("@place", str(place)))
    compiled(tmp_path, "still.c", "axis.c")
    code, figures = checked(tmp_path)
    assert code == 0
    assert figures["after"] == pytest.approx(figures["before"], abs=1e-9)
    assert figures["before"] == pytest.approx(30.0, abs=1e-6)
    assert (figures["kept"], figures["default"]) == (1.0, 1.0)


def layouts(controller: pt.Controller, folder: Path, **options: Any) -> str:
    export(controller, folder, name="axis", **options)
    found = re.search(r"#define SETTINGS_LAYOUT (\d+)u", (folder / "axis.c").read_text())
    assert found
    return found[1]


def test_the_layout_is_that_of_the_structure_not_of_the_numbers(tmp_path: Path) -> None:
    first = layouts(loop("PID"), tmp_path)
    tuned = replace(loop("PID"), feedback=GAINS)
    assert layouts(tuned, tmp_path) == first
    structures = {first, layouts(loop("PID"), tmp_path, single=True)}
    structures.add(layouts(replace(loop("PID"), dt=0.01), tmp_path))
    for name in PARTS:
        if name not in ("nothing", "PID", "PD", "Dahl", "Dahl with dry friction"):
            structures.add(layouts(loop(name), tmp_path))
    # Alike in their numbers: sliding mode with and without an integral, two kinds of damping.
    assert len(structures) == 3 + len(PARTS) - 5 - 2


@needs_gcc
@pytest.mark.parametrize("name", ["PID", "all", "nothing", "repetitive of the paper"])
def test_with_fixed_numbers_there_are_no_settings(name: str, tmp_path: Path) -> None:
    done = export(loop(name), tmp_path, name="axis", fixed=True)
    compiled(tmp_path, "axis.c", flags=(*STRICT, "-c"))
    (tmp_path / "count.c").write_text(
        '#include "axis.h"\n#if AXIS_SETTINGS != 0\n#error settings\n#endif\n'
    )
    compiled(tmp_path, "count.c", flags=(*STRICT, "-c"))
    compiled(tmp_path, "check.c", "axis.c")
    code, figures = checked(tmp_path)
    assert (code, figures["largest"], figures["flags"]) == (0, 0.0, 0.0)
    assert figures["state"] == done.state_bytes
    assert "retune" not in (tmp_path / "axis.c").read_text()


# Controllers that differ in more than their numbers from a PID at 50 Hz, and what is named.
DIFFERENT: dict[str, tuple[dict[str, Any], str]] = {
    "interval": ({"dt": 0.01}, "dt"),
    "limits": ({"limits": (0.0, 70.0)}, "limits"),
    "span": ({"span": (0.0, 1e-4)}, "span"),
    "law": ({"feedback": SLIDING}, "feedback"),
    "filter": ({"filters": [pt.LowPass(5.0)]}, "filters"),
    "repetitive": ({"repetitive": learner(period=5.0, kq=0.3, tq=0.05)}, "entries"),
    "feedforward": (
        {"feedforward": pt.DahlStage.xu_li_2010().inverse(), "span": (-0.01, 0.01)},
        "feedforward",
    ),
    "gain": ({"feedback": pt.Pid(kp=6e9, ti=1e-9, tt=0.02)}, "pid_integral"),
}


@pytest.mark.parametrize("case", DIFFERENT)
def test_a_controller_of_another_structure_is_refused_by_name(case: str) -> None:
    parts, named = DIFFERENT[case]
    first = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedback=PI)
    with pytest.raises(ParameterError, match=named):
        settings_of(replace(first, **parts), like=first)
    assert len(settings_of(first, like=first)) == 4


def test_a_controller_without_numbers_has_no_settings() -> None:
    with pytest.raises(ParameterError, match="expected one with settings"):
        settings_of(loop("nothing"))
    with pytest.raises(ParameterError, match="LAW_A is 1e\\+60"):
        settings_of(
            replace(loop("nothing"), feedback=pt.control.StateSpace([[1e60]], [1.0], [1.0])),
            single=True,
        )
