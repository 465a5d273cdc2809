"""The virtual controller, by its commands and on a clock of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import piezotrack as pt
from gcs_peers import LIMITS, Clock, quiet_stage
from piezotrack.adapters.gcs.protocol import ERRORS
from piezotrack.adapters.simulators.gcs.arguments import Refusal
from piezotrack.adapters.simulators.gcs.controller import ACTIONS, QUERIES, VirtualController

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class Bench:
    """A controller, its clock, and the answers as numbers."""

    def __init__(self, speed: float = 1.0) -> None:
        self.clock = Clock()
        self.controller = VirtualController(quiet_stage(), LIMITS, speed=speed, clock=self.clock)

    def __call__(self, *lines: str) -> list[str]:
        answer: list[str] | None = None
        for line in lines:
            answer = self.controller.ask(line)
        return answer or []

    def value(self, line: str) -> float:
        (answer,) = self(line)
        return float(answer.partition("=")[2])

    def wait(self, seconds: float) -> None:
        self.clock.now += seconds

    def array(self, line: str) -> Array:
        lines = self(line)
        return np.array([row.split() for row in lines[lines.index("# END_HEADER") + 1 :]], float)

    def points(self, table: int, values: Sequence[float] | Array) -> None:
        words = " ".join(f"{value:.9g}" for value in values)
        self(f"WAV {table} X PNT 1 {len(values)} {words}")

    def refusal(self, line: str) -> int:
        with pytest.raises(Refusal) as refused:
            self(line)
        return refused.value.code


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_voltage_moves_the_stage_as_time_goes_by(bench: Bench) -> None:
    before = bench.value("POS? 1")
    bench("SVA 1 40")
    assert bench.value("VOL? 1") == bench.value("SVA? 1") == 40.0
    assert bench.value("POS? 1") == pytest.approx(before, abs=1e-3)
    # Half a period of 160 Hz later it is beyond where it comes to rest.
    bench.wait(0.5 / 160.0)
    overshoot = bench.value("POS? 1")
    bench.wait(2.0)
    rest = bench.value("POS? 1")
    # Of a mode with zeta = 0.065: exp(-pi zeta / sqrt(1 - zeta^2)).
    beyond = np.exp(-np.pi * 0.065 / np.sqrt(1.0 - 0.065**2))
    assert (overshoot - rest) / rest == pytest.approx(beyond, abs=0.03)
    bench("SVR 1 -10")
    assert bench.value("SVA? 1") == 30.0


def test_the_servo_leads_the_stage_to_its_target(bench: Bench) -> None:
    bench("SVA 1 30")
    bench.wait(1.0)
    here = bench.value("POS? 1")
    bench("SVO 1 1")
    # Without a jump.
    assert bench.value("MOV? 1") == pytest.approx(here, rel=1e-6)
    bench("MOV 1 60")
    assert bench("ONT? 1") == ["1=0"]
    assert bench("\x05") == ["0x1"]
    bench.wait(1.0)
    assert bench.value("POS? 1") == pytest.approx(60.0, abs=0.02)
    assert bench("ONT? 1") == ["1=1"]
    bench("MVR 1 -20")
    bench.wait(1.0)
    assert bench.value("POS? 1") == pytest.approx(40.0, abs=0.02)
    # Hysteresis: on the way down less voltage is needed than in proportion.
    held = bench.value("VOL? 1")
    bench("SVO 1 0")
    bench.wait(1.0)
    assert bench.value("VOL? 1") == bench.value("SVA? 1") == pytest.approx(held, abs=0.1)


def test_the_servo_does_not_leave_the_limits_of_the_voltage(bench: Bench) -> None:
    bench("SVO 1 1", f"MOV 1 {bench.value('TMX? 1')}")
    for _ in range(20):
        bench.wait(0.1)
        assert LIMITS[0] <= bench.value("VOL? 1") <= LIMITS[1]


def test_a_wave_goes_out_at_the_rate_of_the_table(bench: Bench) -> None:
    wave = np.arange(1.0, 11.0)
    bench.points(1, wave)
    bench("WSL 1 1", "WGC 1 2", "WTR 1 20 0", "WGO 1 1")
    assert bench("\x09") == ["0x1"]
    # Each point lasts 20 servo cycles of 50 us, 1 ms; the first begins after one of them.
    for k in range(20):
        bench.wait(1e-3)
        assert bench.value("VOL? 1") == wave[k % 10]
    bench.wait(1.1e-3)
    assert bench("\x09") == ["0x0"]
    assert bench.value("VOL? 1") == bench.value("SVA? 1") == 10.0


def test_a_wave_without_end_goes_on_until_it_is_stopped(bench: Bench) -> None:
    bench.points(1, [10.0, 20.0])
    bench("WSL 1 1", "WGC 1 0", "WTR 1 200 0", "WGO 1 1")
    bench.wait(100.0)
    assert bench("WGO? 1") == ["1=1"]
    bench("WGO 1 0")
    assert bench("WGO? 1") == ["1=0"]
    held = bench.value("VOL? 1")
    assert held in (10.0, 20.0)
    bench.wait(1.0)
    assert bench.value("VOL? 1") == held


def test_a_wave_may_be_interpolated_offset_and_begin_where_the_stage_is(bench: Bench) -> None:
    bench.points(1, [0.0, 10.0, 20.0])
    bench("WSL 1 1", "WGC 1 1", "WTR 1 100 1", "WOS 1 5", "WGO 1 1")
    # The first point after 5 ms, the second after 10: 7.5 ms are half the way.
    bench.wait(7.5e-3)
    assert bench.value("VOL? 1") == pytest.approx(10.0, abs=0.2)
    bench.wait(0.1)
    assert bench.value("VOL? 1") == 25.0
    bench("WGO 1 0x101")
    bench.wait(5e-3)
    assert bench.value("VOL? 1") == pytest.approx(25.0, abs=0.2)
    bench.wait(0.1)
    assert bench.value("VOL? 1") == 45.0


def test_with_the_servo_on_a_wave_is_a_path_of_positions(bench: Bench) -> None:
    bench("SVO 1 1", "MOV 1 40")
    bench.wait(1.0)
    t = np.arange(400) * 5e-3
    bench.points(1, 40.0 + 10.0 * np.sin(2.0 * np.pi * 0.5 * t))
    bench("WSL 1 1", "WGC 1 1", "WTR 1 100 0", "RTR 100", "DRC 1 1 2 2 1 1", "WGO 1 1")
    bench.wait(2.5)
    position, target = bench.array("DRR? 1 400 1 2").T
    np.testing.assert_allclose(target, 40.0 + 10.0 * np.sin(2.0 * np.pi * 0.5 * t), atol=1e-6)
    # An integrator of 30 rad/s follows 0.5 Hz with a lag of pi/30.
    lag = np.max(np.abs(position - target)[100:])
    assert 0.5 < lag < 10.0 * np.pi / 30.0 * 1.3


def test_the_recorder_has_what_a_device_on_the_same_clock_has() -> None:
    # As fast as the computer can: the clock jumps at random, the servo's does not.
    bench = Bench(speed=3.0)
    rng = np.random.default_rng(1)
    wave = np.cumsum(rng.uniform(-1.0, 1.0, 300)) + 37.0
    bench.points(2, wave)
    bench("WSL 1 2", "WGC 1 1", "WTR 1 10 0", "RTR 10", "WGO 1 1")
    while bench("\x09") == ["0x1"]:
        bench.wait(rng.uniform(0.0, 5e-3))
    y, u = bench.array("DRR? 1 300 1 2").T
    device = pt.hardware.VirtualDevice(quiet_stage(), limits=LIMITS)
    record = device.play(np.array([float(f"{value:.9g}") for value in wave]), 2000.0)
    np.testing.assert_allclose(u, record.volts, rtol=1e-8)
    np.testing.assert_allclose(y, 1e6 * record.displacement, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("rates", [(10, 7), (7, 10), (1, 4), (12, 3)])
def test_recorder_and_generator_may_have_different_rates(
    bench: Bench, rates: tuple[int, int]
) -> None:
    of_wave, of_record = rates
    wave = np.arange(50.0)
    bench.points(1, wave)
    bench("WSL 1 1", "WGC 1 1", f"WTR 1 {of_wave} 0", f"RTR {of_record}", "DRC 1 1 7", "WGO 1 1")
    bench.wait(0.2)
    count = 50 * of_wave // of_record
    volts = bench.array(f"DRR? 1 {count} 1")[:, 0]
    np.testing.assert_array_equal(volts, wave[np.arange(count) * of_record // of_wave])


def test_what_starts_the_recorder(bench: Bench) -> None:
    bench("RTR 20", "DRC 1 1 7 2 1 2")
    bench("DRT 0 1 0", "SVA 1 10")
    bench.wait(0.5)
    assert bench.value("DRL? 1") == pytest.approx(500, abs=1)
    bench("DRT 0 0 0", "SVA 1 20")
    bench.wait(0.25)
    assert bench.value("DRL? 1") == pytest.approx(750, abs=1)
    bench("DRT 0 4 0")
    bench.wait(0.1)
    assert bench.value("DRL? 1") == pytest.approx(100, abs=1)
    bench("DRT 0 2 0", "SVA 1 30")
    bench.wait(0.1)
    assert bench("DRT? 1") == ["1=0 0"]
    assert bench.array("DRR? 1 50 1").ravel().tolist() == [30.0] * 50
    # It ends when it is full: 65536 samples of 1 ms.
    bench.wait(100.0)
    assert bench.value("DRL? 1") == 65536.0
    assert bench.value("DRL? 3") == 0.0


def test_a_stop_leaves_the_stage_where_it_is(bench: Bench) -> None:
    bench.points(1, np.arange(60.0))
    bench("WSL 1 1", "WGC 1 1", "WTR 1 20 0", "WGO 1 1")
    bench.wait(30.5e-3)
    for line in ("STP", "\x18", "HLT", "HLT 1"):
        assert bench.refusal(line) == 10
        assert bench.value("VOL? 1") == bench.value("SVA? 1") == 29.0
    bench.wait(1.0)
    assert bench.value("VOL? 1") == 29.0
    bench("RBT")
    assert bench("WAV? 1 1") == ["1 1=0"]


def test_segments_of_a_wave_table(bench: Bench) -> None:
    bench("WAV 1 X LIN 100 40 5 80 10 0")
    line = bench.array("GWD? 1 100 1").ravel()
    assert line[:11].tolist() == [5.0] * 11
    assert line[89:].tolist() == [45.0] * 11
    np.testing.assert_allclose(np.diff(line[10:90]), 40.0 / 79.0, rtol=1e-6)
    bench("WAV 1 X LIN 100 40 0 100 0 20")
    soft = np.diff(bench.array("GWD? 1 100 1").ravel())
    # The speed grows in the first points and falls in the last ones.
    assert soft[0] < 0.1 * soft[50]
    np.testing.assert_allclose(soft, soft[::-1], rtol=1e-5)
    bench("WAV 1 X RAMP 200 30 2 200 0 10 100")
    ramp = bench.array("GWD? 1 200 1").ravel()
    assert (ramp.min(), ramp.max()) == (2.0, 32.0)
    assert int(np.argmax(ramp)) in (99, 100)
    bench("WAV 1 X SIN_P 200 30 2 200 0 100", "WAV 1 & SIN_P 200 30 2 200 0 100")
    sine = bench.array("GWD? 1 400 1").ravel()
    k = np.arange(400)
    np.testing.assert_allclose(sine, 17.0 - 15.0 * np.cos(2.0 * np.pi * k / 200.0), atol=1e-6)
    bench("WAV 1 + PNT 1 3 1 2 3")
    np.testing.assert_allclose(
        bench.array("GWD? 1 3 1").ravel() - sine[:3], [1.0, 2.0, 3.0], atol=1e-6
    )
    bench("WCL 1")
    assert bench("WAV? 1 1") == ["1 1=0"]


REFUSED = {
    "FOO": 2,
    "FOO?": 2,
    "POS? 2": 15,
    "POS? A": 15,
    "SVA 2 1": 15,
    "SVA": 26,
    "SVA 1": 24,
    "SVA 1 x": 25,
    "SVA 1 nan": 25,
    "SVA 1 1e999": 25,
    "SVA 1 1_0": 25,
    "SVA 1 \u0661": 25,
    "SVA 1 75.1": 66,
    "SVA 1 -0.1": 66,
    "SVA 1 1 1 2": 22,
    "SVR 1 100": 66,
    "MOV 1 10": 5,
    "MVR 1 10": 5,
    "SVO 1 2": 17,
    "SVO 1 0.5": 17,
    "WAV 0 X PNT 1 1 0": 17,
    "WAV 1 X": 26,
    "WAV 1 Y PNT 1 1 0": 1,
    "WAV 1 X FOO 1 1 0": 1,
    "WAV 1 X PNT 1 2 0": 24,
    "WAV 1 X PNT 5 1 0": 17,
    "WAV 1 X LIN 1 2": 24,
    "WAV 1 X LIN 10 1 0 20 0 0": 17,
    "WAV 1 X LIN 10 1 0 10 0 9": 17,
    "WAV 1 X RAMP 10 1 0 10 0 0 10": 17,
    "WAV 1 X SIN_P 300000 1 0 300000 0 1": 67,
    "WAV 1 + PNT 1 1 0": 17,
    "WAV? 9 1": 17,
    "WAV? 1 2": 54,
    "GWD? 1 1 1": 17,
    "GWD?": 77,
    "WSL 1 9": 17,
    "WSL 2 1": 17,
    "WGC 1 -1": 17,
    "WTR 1 0 0": 17,
    "WTR 1 1": 24,
    "WTR 1 1 2": 17,
    "WTR 1 10001 0": 17,
    "WGO 1 1": 75,
    "WGO 1 2": 17,
    "WGR": 89,
    "DRC 9 1 2": 57,
    "DRC 1 2 2": 59,
    "DRC 1 1 3": 58,
    "DRT 0 9 0": 17,
    "DRT 9 1 0": 57,
    "RTR 0": 17,
    "RTR": 24,
    "RTR 1 2": 24,
    "DRL? 9": 57,
    "DRR? 1 1 1": 77,
    "DRR? 1": 26,
    "DRR? 0 1 1": 17,
    "DRR? 1 1 3": 78,
    "DRR? 1 1 9": 57,
    "SPA? 1 0x1": 54,
    "SPA? 1 zz": 1,
    "SPA? 2 0x0E000200": 17,
    "SPA 1 0x0E000200 1": 64,
    "SPA 1 0x1 1": 54,
    "VOL? 2": 17,
    "*IDN? 1": 24,
    "HLT 2": 15,
    "TWC 1": 24,
}


@pytest.mark.parametrize("line", REFUSED)
def test_a_refused_command_has_its_code_and_changes_nothing(bench: Bench, line: str) -> None:
    queries = ("SVA? 1", "SVO? 1", "WAV?", "WSL?", "WGC?", "WTR?", "DRC?", "DRT?", "RTR?", "WGO?")
    before = [bench(one) for one in queries]
    assert bench.refusal(line) == REFUSED[line]
    assert [bench(one) for one in queries] == before


def test_what_is_not_allowed_with_the_servo_on(bench: Bench) -> None:
    bench("SVO 1 1")
    assert bench.refusal("SVA 1 5") == 79
    assert bench.refusal("SVR 1 5") == 79
    assert bench.refusal("MOV 1 500") == 7
    assert bench.refusal("MVR 1 -500") == 7
    bench.points(1, [500.0])
    bench("WSL 1 1")
    assert bench.refusal("WGO 1 1") == 7


def test_what_is_not_allowed_while_the_generator_runs(bench: Bench) -> None:
    bench.points(1, [1.0, 2.0])
    bench("WSL 1 1", "WGC 1 0", "WTR 1 100 0", "WGO 1 1")
    for line in (
        *("SVA 1 5", "SVO 1 1", "WAV 1 X PNT 1 1 0", "WCL", "WSL 1 2", "WTR 1 1 0", "WGO 1 1"),
    ):
        assert bench.refusal(line) == 73
    bench.points(2, [3.0])
    bench("WGR")
    bench.wait(0.1)
    assert bench.value("DRL? 1") > 0


def test_a_wave_beyond_the_limits_does_not_start(bench: Bench) -> None:
    bench.points(1, [0.0, 75.1])
    bench("WSL 1 1", "WGC 1 1")
    assert bench.refusal("WGO 1 1") == 66
    assert bench("\x09") == ["0x0"]
    bench.points(1, [0.0, 75.0])
    bench("WOS 1 0.5")
    assert bench.refusal("WGO 1 1") == 66


def test_every_command_is_in_the_help(bench: Bench) -> None:
    help_text = bench("HLP?")
    listed = {line.split()[0] for line in help_text[1:-1]}
    known = {name for name in (*ACTIONS, *QUERIES) if name.isprintable()}
    assert listed == known | {"ERR?", "#5", "#7", "#9", "#24"}
    # Every query without arguments is answered, but for those about data that is not there.
    for name in sorted(listed - {"ERR?", "GWD?", "DRR?"}):
        if name.endswith("?"):
            assert bench(name), name
    assert bench("") == []
    assert bench("  pos?   1 ") == bench("POS? 1")


def test_a_stage_that_rests_is_not_simulated_for_ever(bench: Bench) -> None:
    bench("SVA 1 30")
    bench.wait(60.0)
    settled = bench.value("POS? 1")
    bench.wait(1e7)
    assert bench.value("POS? 1") == pytest.approx(settled, abs=1e-3)
    bench("SVO 1 1", "MOV 1 40")
    bench.wait(1e7)
    assert bench.value("POS? 1") == pytest.approx(40.0, abs=0.02)


def test_a_reading_in_a_slow_table_is_not_old(bench: Bench) -> None:
    # Points of half a second: the mode of 160 Hz is over after a tenth of one.
    bench.points(1, [10.0, 60.0])
    bench("WSL 1 1", "WGC 1 1", "WTR 1 10000 0", "RTR 10000", "WGO 1 1")
    bench.wait(0.5)
    first = bench.value("POS? 1")
    bench.wait(0.25)
    settled = bench.value("POS? 1")
    assert settled > first + 9.0
    bench.wait(0.4)
    assert bench.value("POS? 1") > settled + 45.0
    # Each sample is read at the edge at which the next voltage goes out.
    np.testing.assert_allclose(bench.array("DRR? 1 2 1").ravel(), [first, settled], atol=1e-3)


def test_a_wave_that_the_computer_cannot_keep_up_with_goes_slower(bench: Bench) -> None:
    bench.points(1, np.arange(10.0))
    bench("WSL 1 1", "WGC 1 0", "WTR 1 100 0", "RTR 1000", "WGO 1 1")
    bench.wait(1e6)
    # Two minutes have been simulated, and are recorded in steps of 50 ms.
    assert bench.value("DRL? 1") == pytest.approx(120.0 / 0.05, abs=1)
    bench.wait(1.0)
    assert bench.value("DRL? 1") == pytest.approx(121.0 / 0.05, abs=1)


def test_a_stage_whose_motion_its_sensor_does_not_see_is_refused() -> None:
    still = pt.VirtualStage.of(quiet_stage().stage, resolution=1e-3)
    with pytest.raises(pt.ParameterError, match="expected one that moves"):
        VirtualController(still, LIMITS)


ODD = ["1", "2", "0", "-1", "X", "&", "+", "PNT", "LIN", "RAMP", "SIN_P", "1e300", "-1e308", "nan"]
ODD += ["9" * 5000, "0x", "0x0E000200", "\u00b2", "\u0661", "=", "?", "10", "0.5", "5", "300000"]


def test_whatever_is_sent_is_answered_or_refused(bench: Bench) -> None:
    rng = np.random.default_rng(7)
    names = [*ACTIONS, *QUERIES]
    codes = set()
    for _ in range(4000):
        words = rng.choice(np.array(ODD, dtype=object), rng.integers(0, 9)).tolist()
        line = " ".join([str(rng.choice(names)), *words])
        bench.wait(rng.uniform(0.0, 1e-3))
        try:
            answer = bench.controller.ask(line)
        except Refusal as refused:
            codes.add(refused.code)
        else:
            assert answer is None or (answer and all(isinstance(one, str) for one in answer))
        assert LIMITS[0] <= bench.value("VOL? 1") <= LIMITS[1]
    assert codes <= set(ERRORS)
    # Most of what a command can be refused for has been met.
    assert len(codes) > 12
