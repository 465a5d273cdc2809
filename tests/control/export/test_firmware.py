"""Firmware projects: on this computer and on emulated boards, with a simulated stage."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from boards import (
    BOARDS,
    MACHINES,
    SPAN,
    booted,
    connected,
    controller,
    made,
    needs_cross,
    within,
)
from c_exports import DAHL, loop, needs_gcc
from folders import ROOT
from piezotrack.errors import ParameterError

if TYPE_CHECKING:
    from pathlib import Path

SAFE = 0.0


@pytest.mark.parametrize("board", BOARDS)
def test_from_a_log_to_a_learnt_raster_and_a_tracked_reference(
    board: str, tmp_path: Path, stage: pt.hardware.Converters
) -> None:
    one = controller()
    with booted(one, tmp_path, board, stage.address) as (address, process):
        device = connected(address)
        log = pt.measure(device, "decaying:2Hz,0..75V,2s", rate=500.0)
        fit = pt.identify(log, "prandtl-ishlinskii")
        assert fit.cost < 0.15e-6
        line = pt.triangle(frequency=2.0, low=2e-5, high=6e-5, duration=1.0, rounding=0.2)
        online = controller(feedforward=fit.inverse(), feedback=None, filters=[])
        learnt = pt.learn(device, line, online, trials=5)
        assert learnt.errors[learnt.best] < 0.3 * learnt.errors[0]
        run = device.track(replace(one, feedforward=fit.inverse()), line)
        # The samples are those of the loop: reference, voltage and reading belong together.
        assert np.array_equal(run.desired, line.sample(1e-3).x)
        assert float(np.sqrt(np.mean((run.measured - run.desired)[600:] ** 2))) < 1.5e-6
        # A board that stops leads its output to the safe voltage, in steps that are small.
        device.stop()
        assert device.state().mode == "off"
        assert stage.voltage == SAFE
        device.hold(40.0)
        assert within(lambda: stage.voltage > 39.9)
        # What a client was, is gone: the link with it.
        device._line._closed.set()
        device._line._link.close()
        assert within(lambda: stage.voltage == SAFE)
        again = connected(address)
        assert again.state().fault == "link"
        with pytest.raises(pt.DeviceError, match="no fault"):
            again.hold(10.0)
        again.clear()
        again.hold(10.0)
        assert again.voltage == 10.0
        again.close()
        assert process.poll() is None


@needs_gcc
@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
@pytest.mark.parametrize(
    "parts", [{}, {"feedforward": DAHL.inverse(), "filters": []}], ids=["voltages", "online"]
)
def test_the_loop_of_a_board_is_that_of_the_session(
    parts: dict[str, Any], single: bool, tmp_path: Path, stage: pt.hardware.Converters
) -> None:
    """To the bit in double: the same readings give the same voltages."""
    one = controller(**parts)
    with booted(one, tmp_path, "host", stage.address, single=single) as (address, _):
        device = connected(address)
        device.hold(20.0)
        run = device.track(one, "sine:2Hz,10..60um,1s")
        recorded = device.log()
        device.close()
    session = one.start(present=20.0)
    online = one.feedforward is not None
    x = np.append(run.desired, run.desired[-1])
    commands = [
        session.step(
            x[k],
            run.measured[k],
            preview=x[k + 1] if online else None,
            feedforward=None if online else 0.0,
        )
        for k in range(run.t.size)
    ]
    assert np.array_equal(recorded.u, run.voltage)
    difference = float(np.max(np.abs(np.array(commands) - run.voltage)))
    assert difference < 5e-3 if single else difference == 0.0


@needs_cross
@pytest.mark.parametrize("board", MACHINES)
@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
@pytest.mark.parametrize("name", ["PID", "filters and jumps", "state space", "Dahl", "repetitive"])
def test_a_step_on_a_board_has_the_bits_and_the_instructions_that_are_stated(
    name: str, single: bool, board: str, tmp_path: Path
) -> None:
    one = replace(loop(name), span=SPAN) if loop(name).span is None else loop(name)
    done = pt.control.export_controller(one, tmp_path, to="firmware", name="axis", single=single)
    printed = made(tmp_path, f"count-{board}")
    counts = dict(re.findall(r"(mean|worst|state bytes|steps apart) (\d+)", printed))
    assert int(counts["steps apart"]) == 0
    assert int(counts["state bytes"]) == done.state_bytes
    assert done.instructions is not None
    assert done.most_instructions is not None
    if single or board == "m7":
        # The floating-point unit has numbers of this size.
        assert done.most_instructions / 20 < int(counts["worst"]) <= done.most_instructions
        if done.most_instructions == done.instructions:
            assert int(counts["mean"]) > 0.5 * done.instructions


RUST = """
#include <stdint.h>
typedef REAL real;
typedef struct { uint32_t nothing; } inner_state;
int PREFIX_begin(void);
real PREFIX_volts(real reference, real measured, real feedforward);
void PREFIX_gave(real volts);
void PREFIX_forget(void);
#define inner_init(loop) ((void)(loop), (void)PREFIX_begin())
#define inner_step(loop, reference, next, reading, volts) PREFIX_volts(reference, reading, volts)
#define inner_applied(loop, volts) (PREFIX_gave(volts), 1)
#define inner_reset(loop) PREFIX_forget()
"""
# What this computer computes for the vectors, to the last bit.
HOST = """
#include <stdio.h>
#include "configuration.h"
#include "vectors.h"
/* Of core, which was compiled to unwind; nothing here does. */
void rust_eh_personality(void);
void rust_eh_personality(void)
{
}
int main(void)
{
    inner_state loop;
    unsigned i;
    inner_init(&loop);
    for (i = 0; i < VECTORS; i++) {
        const real *row = vectors[i];
        if (row[4] > 0) {
            inner_reset(&loop);
        }
        printf("%a\\n", (double)inner_step(&loop, row[0], row[1], row[2], row[3]));
        if (row[5] - row[5] <= 0) {
            inner_applied(&loop, row[5]);
        }
    }
    return 0;
}
"""
THUMB = "thumbv7em-none-eabihf"


def rust_library(folder: Path, target: str | None) -> Path:
    """Build the axes in Rust, for this computer or for a board."""
    crate = ROOT / "tests" / "no_std" / "Cargo.toml"
    built = subprocess.run(
        [
            *("cargo", "build", "--locked", "--release", "--manifest-path", str(crate)),
            *("--target-dir", str(folder / "rust")),
            *(("--target", target) if target else ()),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    if "target may not be installed" in built.stderr:
        pytest.skip(f"no board is compiled for: {target} is not installed")
    assert built.returncode == 0, built.stderr
    return folder / "rust" / (target or "") / "release" / "libpiezotrack_no_std.a"


def rust_project(folder: Path, *, single: bool) -> None:
    """Write a firmware project around an axis in Rust."""
    one = replace(loop("PID"), span=SPAN)
    pt.control.export_controller(one, folder, to="firmware", name="axis", single=single)
    texts = ("float", "single") if single else ("double", "axis")
    written = RUST.replace("REAL", texts[0]).replace("PREFIX", texts[1])
    (folder / "configuration.h").write_text(written)


def linked(folder: Path, library: Path) -> None:
    makefile = (folder / "Makefile").read_text()
    makefile = makefile.replace(
        "COUNT := count.c mps2_startup.c $(NAME).c", f"COUNT := count.c mps2_startup.c {library}"
    )
    (folder / "Makefile").write_text(makefile)


@needs_cross
@pytest.mark.slow
def test_the_rust_controller_gives_the_same_bits_on_a_board(tmp_path: Path) -> None:
    library = rust_library(tmp_path, THUMB)
    rust_project(tmp_path, single=False)
    linked(tmp_path, library)
    printed = made(tmp_path, "count-m4")
    assert "steps apart 0 of 2000" in printed


@needs_cross
@needs_gcc
@pytest.mark.slow
def test_the_rust_controller_in_single_precision_gives_the_same_bits_on_a_board(
    tmp_path: Path,
) -> None:
    library, here = rust_library(tmp_path, THUMB), rust_library(tmp_path, None)
    rust_project(tmp_path, single=True)
    (tmp_path / "bits.c").write_text(HOST)
    subprocess.run(["gcc", "-o", "bits", "bits.c", here, "-lm"], cwd=tmp_path, check=True)
    done = subprocess.run(
        ["./bits"], cwd=tmp_path, check=True, stdout=subprocess.PIPE, text=True, timeout=60
    )
    commands = [float.fromhex(text) for text in done.stdout.split()]
    assert len(commands) == 2000
    # Not a loop that does nothing.
    assert max(commands) == 75.0
    assert len(set(commands)) > 1000
    expected = iter(f"{volts:.9e}f" for volts in commands)
    vectors = (tmp_path / "vectors.h").read_text()
    vectors = re.sub(r"[^ ]+\},\n", lambda _: next(expected) + "},\n", vectors)
    vectors = re.sub(r"(VECTORS_BOUND) .*", r"\1 0.0f", vectors)
    assert next(expected, None) is None
    (tmp_path / "vectors.h").write_text(vectors)
    linked(tmp_path, library)
    assert "steps apart 0 of 2000" in made(tmp_path, "count-m4")


@needs_cross
@pytest.mark.slow
def test_a_step_of_the_rust_controller_in_single_precision_calls_no_soft_float(
    tmp_path: Path,
) -> None:
    """A linker that collects garbage keeps what the function reaches, and no more.

    `parts_volts` steps every law and every inverse that can be in single precision.
    """
    library = rust_library(tmp_path, THUMB)

    def reached(function: str) -> set[str]:
        archive = str(library)
        linker = ["arm-none-eabi-ld", "--gc-sections", "-e", function, archive, "-o", "reached"]
        subprocess.run(linker, cwd=tmp_path, check=True)
        done = subprocess.run(
            ["arm-none-eabi-nm", "reached"],
            cwd=tmp_path,
            check=True,
            stdout=subprocess.PIPE,
            text=True,
        )
        names = {line.split()[-1] for line in done.stdout.splitlines()}
        assert function in names
        # Those of Arm's run-time ABI for floating point, from and to integers too.
        return {one for one in names if re.match(r"__aeabi_(c?[df]|u?[il]2[df]|u?l2[df])", one)}

    assert {"__aeabi_dadd", "__aeabi_dmul"} <= reached("axis_volts")
    for function in ("single_volts", "single_gave", "single_forget", "parts_volts"):
        assert not reached(function), function


@needs_gcc
@pytest.mark.parametrize("single", [False, True], ids=["double", "float"])
def test_gains_change_while_it_runs_as_those_of_a_session(
    single: bool, tmp_path: Path, stage: pt.hardware.Converters
) -> None:
    """No bump, and to the bit in double those of `Session.retune`; a restart remembers them."""
    one = controller(filters=[])
    other = replace(one, feedback=pt.Pid.from_um(kp=0.03, ti=0.01))
    kept = str(tmp_path / "kept")
    with booted(one, tmp_path, "host", stage.address, kept, single=single) as (address, _):
        device = connected(address)
        device.follow(4e-5)
        assert within(lambda: device.state().recorded > 300)
        device.retune(other)
        with pytest.raises(pt.DeviceError, match="moves"):
            device.save_settings()
        assert device.settings()["pid_proportional"] == pytest.approx(3e4, rel=1e-6)
        assert within(lambda: device.state().recorded > 2000)
        device.stop()
        log = device.log()
        device.save_settings()
        device.close()
    if log.u.size < 4000:
        session, changed = one.start(), None
        for k, (volts, reading) in enumerate(zip(log.u, log.recorded, strict=True)):
            before = session.last.voltage
            asked = session.step(4e-5, reading, feedforward=0.0)
            if changed is None and abs(asked - volts) > (1e-4 if single else 0.0):
                # The settings came between these samples.
                changed = k
                session = one.start()
                for earlier in log.recorded[:k]:
                    session.step(4e-5, earlier, feedforward=0.0)
                session.retune(other)
                assert session.last.voltage == before
                asked = session.step(4e-5, reading, feedforward=0.0)
            assert abs(asked - volts) <= (2e-4 if single else 0.0), k
        assert changed is not None
    with booted(one, tmp_path, "host", stage.address, kept) as (address, _):
        device = connected(address)
        assert device.settings()["pid_proportional"] == pytest.approx(3e4, rel=1e-6)
        device.close()
    # An image of another controller is refused: the design's numbers are there.
    with (tmp_path / "kept").open("r+b") as file:
        file.seek(4)
        file.write(b"none")
    with booted(one, tmp_path, "host", stage.address, kept) as (address, _):
        device = connected(address)
        assert device.settings()["pid_proportional"] == pytest.approx(2e4, rel=1e-6)
        for wrong in (
            controller(),
            replace(one, limits=(0.0, 30.0)),
            replace(one, dt=1e-4),
            replace(one, span=(-1e-5, 1e-4)),
            replace(one, feedback=pt.control.LeadLag(kp=1e5, lead=0.01, lag=0.1)),
        ):
            with pytest.raises(ParameterError, match="firmware"):
                device.retune(wrong)
        assert device.settings()["pid_proportional"] == pytest.approx(2e4, rel=1e-6)
        device.close()


@needs_gcc
def test_a_log_of_a_recording_that_goes_on_has_no_gap(
    tmp_path: Path, stage: pt.hardware.Converters, monkeypatch: pytest.MonkeyPatch
) -> None:
    with booted(controller(), tmp_path, "host", stage.address) as (address, _):
        device = connected(address)
        line = device._line
        device.follow(4e-5)
        assert within(lambda: device.state().recorded > 5000)
        ask, meanwhile, restarts = line.ask, 300, False

        def later(message: str) -> str:
            """Let samples pass before each answer."""
            if message.startswith("read"):
                if restarts:
                    ask("follow 5e-5")
                before = 0 if restarts else device.state().recorded
                while device.state().recorded <= before + meanwhile:
                    pass
            return ask(message)

        monkeypatch.setattr(line, "ask", later)
        state = device.state()
        rows = line.newest(state.recorded)
        # As far back as they are there while 428 of 4096 places are used for 128 samples.
        assert 128 <= len(rows) < 4096 - meanwhile
        assert np.array_equal(np.diff(rows[:, 0]), np.ones(len(rows) - 1))
        assert 0 <= rows[-1, 0] - state.tick < 100
        meanwhile = 4200
        with pytest.raises(pt.DeviceError, match="written over"):
            device.log()
        # A recording that begins anew is another one.
        meanwhile, restarts = 3000, True
        rows = line.newest(3000)
        assert len(rows) <= 128
        monkeypatch.undo()
        assert within(lambda: device.state().recorded > 4500)
        device.stop()
        ended = device.state()
        assert ended.recorded > 4096
        whole = line.newest(ended.recorded)
        assert len(whole) == 4096
        assert np.array_equal(np.diff(whole[:, 0]), np.ones(4095))
        log = device.log()
        assert np.array_equal(log.u, whole[:, 3])
        assert np.array_equal(log.recorded, whole[:, 4])
        device.close()


@needs_gcc
def test_a_limit_that_a_float_cannot_have_is_reached(
    tmp_path: Path, stage: pt.hardware.Converters
) -> None:
    """The float nearest to 3.6 V is below it."""
    one = controller(limits=(0.0, 3.6))
    with booted(one, tmp_path, "host", stage.address, single=True) as (address, _):
        device = connected(address)
        assert device.limits == (0.0, 3.6)
        log = pt.measure(device, "decaying:5Hz,0..3.6V,1s", rate=500.0)
        device.close()
    assert log.u.max() == pytest.approx(3.6, rel=1e-7)


@needs_gcc
def test_numbers_that_are_fixed_cannot_be_changed(
    tmp_path: Path, stage: pt.hardware.Converters
) -> None:
    one = controller(filters=[])
    with booted(one, tmp_path, "host", stage.address, fixed=True) as (address, _):
        device = connected(address)
        assert device.settings() == {}
        with pytest.raises(ParameterError, match="fixed"):
            device.retune(one)
        run = device.track(one, "sine:2Hz,10..60um,0.5s")
        assert run.metrics.rms_error < 25e-6
        device.close()


def test_a_wrong_address_is_told() -> None:
    with pytest.raises(ParameterError, match="firmware://HOST:PORT"):
        pt.hardware.connect("firmware:")
    with pytest.raises(pt.DeviceError, match="does not answer"):
        pt.hardware.connect("firmware://127.0.0.1:1")
    with pt.hardware.VirtualScpi(pt.hardware.connect("virtual:")) as other:  # type: ignore[arg-type]
        place = f"{other.address[0]}:{other.address[1]}"
        with pytest.raises(pt.DeviceError, match="id"):
            pt.hardware.connect(f"firmware://{place}?timeout=0.2s")


@needs_gcc
@pytest.mark.parametrize("name", ["controller", "status", "loop", "axis_1"])
def test_names_that_a_person_gives_build(name: str, tmp_path: Path) -> None:
    pt.control.export_controller(controller(), tmp_path, to="firmware", name=name)
    made(tmp_path, "host")
    assert (tmp_path / f"{name}-host").exists()


def test_what_cannot_be_a_firmware_is_refused(tmp_path: Path) -> None:
    export = pt.control.export_controller
    with pytest.raises(ParameterError, match="span"):
        export(controller(span=None), tmp_path, to="firmware")
    with pytest.raises(ParameterError, match="a file of the firmware"):
        export(controller(), tmp_path, to="firmware", name="ring")
    for name in ("BOARD", "mps2_startup", "inner"):
        with pytest.raises(ParameterError, match="a file of the firmware"):
            export(controller(), tmp_path, to="firmware", name=name)
    with pytest.raises(ParameterError, match="loaded over its link"):
        export(controller(), tmp_path, to="firmware", table=np.ones(100))
    fast = controller(dt=1e-5, feedforward=DAHL.inverse())
    with pytest.raises(ParameterError, match="expected a step within 10 us") as refused:
        export(fast, tmp_path, to="firmware", clock=168e6)
    with pytest.raises(ParameterError, match="reference="):
        export(fast, tmp_path, to="c99", clock=168e6)
    assert not list(tmp_path.iterdir())
    # What is suggested is accepted by this form.
    assert "reference=" not in str(refused.value)
    export(replace(fast, feedforward=None), tmp_path / "firmware", to="firmware", clock=168e6)
    motion = pt.sine(frequency=50.0, low=2e-5, high=4e-5, duration=0.04)
    export(fast, tmp_path / "c99", to="c99", reference=motion, clock=168e6)
    slow = controller(dt=1e-3, feedforward=DAHL.inverse())
    assert export(slow, tmp_path, to="firmware", clock=168e6).most_instructions > 10_000  # type: ignore[operator]


def test_a_damping_law_beside_a_feedforward_of_the_client_is_refused(tmp_path: Path) -> None:
    # On the board it would take the motion that the client asks for as one to damp.
    plays = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(1e-7,))
    law = loop("Dahl with damping").feedback
    one = controller(feedback=law, filters=[])
    pt.control.export_controller(one, tmp_path / "alone", to="firmware", name="axis")
    with pytest.raises(ParameterError, match="feedforward is left to the client: expected"):
        pt.control.export_controller(
            replace(one, feedforward=plays.inverse()), tmp_path, to="firmware", name="axis"
        )
    dahl = replace(one, feedforward=DAHL.inverse())
    pt.control.export_controller(dahl, tmp_path / "board", to="firmware", name="axis")
