"""``piezotrack learn --device``: tables that a device plays, and what is left where it fails."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from commands import COMMAND, names, ran, refusal, table
from piezotrack.hardware import VirtualDevice
from served import serving

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

PLAYS = pt.PrandtlIshlinskiiStage(
    linear=1e-6,
    thresholds=(5.0, 15.0),
    weights=(2e-7, 2e-7),
    frequency=160.0,
    damping_ratio=0.05,
)
LINE = ("triangle:5Hz,10..50um,1s,rounding=0.2",)
LEARN = ("learn", "model.json", *LINE, "--dt", "0.001", "--limits", "0:75", "--cutoff", "40")
VIRTUAL = ("--device", "virtual:stage.json")


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The model's gain is a tenth below that of the stage behind the device."""
    monkeypatch.chdir(tmp_path)
    for name, gain in (("model", 1.0), ("stage", 1.1)):
        pt.identification.IdentifiedModel(
            model=pt.PrandtlIshlinskiiStage(
                linear=gain * 1e-6,
                thresholds=(5.0, 15.0),
                weights=(gain * 2e-7, gain * 2e-7),
                frequency=160.0,
                damping_ratio=0.05,
            ),
            offset=0.0,
            offset_fitted=False,
            scale_assumed=False,
            stroke=1e-4,
            # As of a record from 0 to 75 V.
            details={"provenance": {"data": {"drive_range": [0.0, 75.0]}}},
        ).save(f"{name}.json")


def errors_of(lines: list[str]) -> list[float]:
    """The rms errors of the lines of trials, in nm."""
    return [float(line.split()[1]) for line in lines if line.split()[:1][0].isdecimal()]


@pytest.mark.slow
def test_a_loop_that_fails_says_where_its_beginning_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the first period of the reference, of which nothing would count in a whole run."""
    # An interval that a busy computer keeps too.
    loop = pt.Controller(dt=0.25, limits=(0.0, 75.0), feedback=pt.Pid.from_um(kp=0.02, ti=0.75))
    loop.save("loop.json")
    readings = [0]

    class Lost(VirtualDevice):
        def exchange(self, volts: float) -> float:
            readings[0] += 1
            if readings[0] == 340:
                raise pt.DeviceError("the connection was lost")
            return super().exchange(volts)

    use(monkeypatch, Lost(pt.VirtualStage.of(PLAYS, limits=(0.0, 75.0))))
    motion = "sine:0.016Hz,20..60um,250s"
    said = refusal("track", "loop.json", "--device", "virtual:", motion, "--out", "tk")
    assert "the connection was lost; the run up to then is in tk" in said
    assert names("tk") == ["tracking.csv", "tracking.json", "tracking.png", "tracking.svg"]


def test_a_line_of_a_raster_is_learnt_on_a_device_and_the_table_follows_it() -> None:
    printed = ran(*LEARN, *VIRTUAL, "--trials", "6", "-o", "out")
    assert names("out") == ["learnt.csv", "learnt.png", "learnt.svg"]
    assert "\nfeedforward learnt, played on virtual amplifier\n" in printed
    errors = errors_of([line for line in printed.splitlines() if line.strip()])
    assert all(after < 0.6 * before for before, after in pairwise(errors[:4]))
    # A tenth of the gain, and what the mode makes of the turns above the cutoff.
    assert errors[0] > 1500.0
    assert min(errors) < 0.1 * errors[0]
    # The same table on the same stage, and no command of this package.
    written = table("out/learnt.csv")
    stage = pt.identification.load("stage.json").model
    record = stage.simulate(np.tile(written["voltage_V"], 6), 1e-3, hold="zoh").x[-200:]
    left = np.sqrt(np.mean((1e-6 * written["desired_um"] - record) ** 2))
    assert left == pytest.approx(1e-9 * min(errors), rel=0.2)


def test_trials_begin_and_end_at_the_rest_that_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    device = Watched()
    use(monkeypatch, device)
    ran(*LEARN, "--device", "virtual:", "--rest", "12.5", "--trials", "2")
    assert [(one[0], one[-1]) for one in device.tables] == [(12.5, 12.5)] * 2
    assert device.held == 12.5


def test_the_limits_are_those_of_record_and_device_where_none_are_given(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    device = Watched(limits=(0.5, 60.0))
    use(monkeypatch, device)
    short = ("learn", "model.json", *LINE, "--dt", "0.001", "--cutoff", "40", "--trials", "1")
    document = json.loads(ran(*short, "--device", "virtual:", "--json"))
    assert document["limits"]["value"] == [0.5, 60.0]
    # What was asked for is not changed.
    said = refusal(*short, "--device", "virtual:", "--limits", "0:75", "--overwrite")
    assert "limits of the controller are 0 to 75 V: expected a range within 0.5 to 60 V" in said


def test_a_controller_in_another_process_learns_the_same() -> None:
    stage = ("stage.json", "--limits", "0:75", "--speed", "100")
    with serving(*stage) as (_, address, _):
        printed = ran(*LEARN, "--device", address, "--trials", "4")
        there = pt.hardware.connect(address)
        assert isinstance(there, pt.hardware.GcsDevice)
        assert there.voltage == 0.0
        there.close()
    again = ran(*LEARN, *VIRTUAL, "--trials", "4", "--overwrite")
    errors, other = (
        errors_of([x for x in text.splitlines() if x.strip()]) for text in (printed, again)
    )
    # The servo clock of 20 kHz reads the voltage within the sample, not at its beginning.
    assert errors[0] == pytest.approx(other[0], rel=0.2)
    assert errors[-1] < 0.1 * errors[0]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="Windows sends Ctrl-C in another way")
@pytest.mark.parametrize(
    ("number", "code", "word"),
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")],
)
def test_a_signal_leads_the_output_to_rest_and_keeps_the_table(
    number: signal.Signals, code: int, word: str
) -> None:
    stage = ("stage.json", "--limits", "0:75", "--speed", "2")
    with serving(*stage) as (_, address, _):
        work = [*COMMAND, *LEARN, "--device", address, "--rest", "2.5", "-o", "kept.csv"]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        there = pt.hardware.connect(address)
        assert isinstance(there, pt.hardware.GcsDevice)
        with subprocess.Popen(work, text=True, **pipes) as child:  # type: ignore[call-overload]
            try:
                assert child.stdout is not None
                # Until the first trial is there, and the next one is being played.
                assert any(line.startswith("    0 ") for line in child.stdout)
                while there.voltage <= 10.0:
                    assert child.poll() is None
                child.send_signal(number)
                _, message = child.communicate(timeout=60.0)
            finally:
                child.kill()
        assert there.voltage == 2.5
        there.close()
    assert child.returncode == code
    assert message == f"piezotrack: {word}; the best table so far, of trial 0, is in kept.csv\n"
    written = table("kept.csv")
    np.testing.assert_allclose(written["voltage_V"], written["feedforward_V"], rtol=1e-9)


class Watched(VirtualDevice):
    """The stage behind the device; it keeps the tables, and does something at the third play."""

    def __init__(
        self, then: Callable[[], None] = lambda: None, limits: tuple[float, float] = (0.0, 75.0)
    ) -> None:
        super().__init__(pt.VirtualStage.of(PLAYS, noise=5e-9), limits=limits)
        self.tables: list[NDArray[np.float64]] = []
        self.then = then

    def play(
        self, volts: NDArray[np.float64], rate: float, *, lead_in: float = 0.0
    ) -> pt.hardware.Record:
        self.tables.append(volts)
        made = super().play(volts, rate, lead_in=lead_in)
        if len(self.tables) == 3:
            # Somewhere in the table.
            self.hold(40.0)
            self.then()
        return made


def use(monkeypatch: pytest.MonkeyPatch, device: VirtualDevice) -> None:
    monkeypatch.setattr("piezotrack.hardware.addresses.connect", lambda _: device)


def test_what_was_learnt_before_the_device_failed_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise pt.DeviceError("the connection was lost")

    device = Watched(fail)
    use(monkeypatch, device)
    done = ("--device", "virtual:", "-o", "out", "--quiet")
    said = refusal(*LEARN, *done)
    assert said == (
        "the connection was lost; the best table so far, of trial 1, is in "
        f"{Path('out', 'learnt.csv')}"
    )
    assert device.held == 0.0
    assert names("out") == ["learnt.csv", "learnt.png", "learnt.svg"]
    # A settled period of the second table is in the table that was played.
    written = table("out/learnt.csv")["voltage_V"]
    played = device.tables[1]
    assert any(
        np.allclose(played[k : k + written.size], written, atol=1e-7)
        for k in range(played.size - written.size)
    )


def test_a_device_that_may_be_anywhere_is_said_although_nothing_can_be_written(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail() -> None:
        monkeypatch.setattr(device, "_open", False)
        monkeypatch.setattr(device, "exchange", fail)
        # A file where the folder of the table was.
        Path("out").write_text("", encoding="utf-8")
        raise pt.DeviceError("the connection was lost")

    device = Watched(fail)
    use(monkeypatch, device)
    said = refusal(*LEARN, "--device", "virtual:", "-o", "out/learnt.csv", "--quiet")
    assert said.startswith("the connection was lost; the output could not be led to 0 V (")
    assert "it may be anywhere in the table; what was learnt is lost: " in said


def test_before_the_first_trial_is_there_nothing_is_written(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    device = Watched()
    monkeypatch.setattr(device, "_memory", 100)
    use(monkeypatch, device)
    said = refusal(*LEARN, "--device", "virtual:", "--quiet")
    assert "samples: expected at most 100, the memory of virtual amplifier" in said
    assert not Path("learnt.csv").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--stage stage.json", "--stage has no effect with --device: expected it left out"),
        ("--noise 5nm", "--noise has no effect with --device"),
        ("--bandwidth 100", "--bandwidth has no effect with --device"),
        ("--seed 2", "--seed has no effect with --device"),
        ("--kp 0.1 --ti 0.1", "--kp has no effect with --device"),
        ("--feedback", "--feedback has no effect with --device"),
        ("--rest -1", "rest is -1 V at sample 0: expected 0 to 75 V"),
        ("--device usb:1", "device is 'usb:1': expected an address"),
        ("--device virtual:gone.json", "gone.json: there is no such file"),
        ("--device scpi://localhost:1?unit=um&limits=0..75V", "localhost:1 does not answer"),
        ("--limits 0:90", "limits of the controller are 0 to 90 V: expected a range within 0 to"),
        ("--dt 1e-6", "rate is 1e+06 Hz: expected 0.1 to 100000 Hz, the rates of the device"),
        ("MOTION chirp:1..5Hz,10..50um,2s", "does not repeat: expected one that does"),
        ("MOTION triangle:5Hz,10..500um,1s", "reference is 500 um"),
        ("--cutoff 400", "learning does not converge on Prandtl-Ishlinskii"),
        ("--out model.json/t.csv", "model.json cannot be made a folder"),
    ],
)
def test_what_a_device_cannot_do_is_refused_before(options: str, words: str) -> None:
    before = sorted(Path().rglob("*"))
    typed = options.split()
    words_of = [*LEARN[:2], typed[1], *LEARN[3:]] if typed[0] == "MOTION" else [*LEARN]
    rest = [] if typed[0] == "MOTION" else typed
    said = refusal(*words_of, *VIRTUAL, *rest, "--quiet")
    assert words in said
    assert sorted(Path().rglob("*")) == before


def test_a_rest_belongs_to_a_device() -> None:
    said = refusal(*LEARN, "--rest", "5")
    assert said == "--rest has no effect without --device: expected it left out"
