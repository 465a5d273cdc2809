"""Controller files: every part comes back to the last bit, and what is not right is named."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import piezotrack as pt
from all_stages import STAGES
from piezotrack.errors import DataError, ParameterError

if TYPE_CHECKING:
    from collections.abc import Callable

# A number without a short decimal, so that a lost bit shows.
THIRD = 1.0 / 3.0
PID = pt.Pid(kp=1e5 * THIRD, ti=0.01 * THIRD, td=0.001 * THIRD, tt=0.7 * THIRD)
SLIDING = pt.control.SlidingMode(switching=3 * THIRD, layer=2e-5 * THIRD)
LAWS: dict[str, Any] = {
    "none": None,
    "PID": PID,
    "PD": pt.Pid(kp=1e5, ti=math.inf, td=0.001),
    "state space": pt.control.StateSpace(
        [[0.9, THIRD], [0.0, 0.8]], [1e3, THIRD], [1.0, 2.0], THIRD
    ),
    "state space with a gain": pt.control.StateSpace([[1.0]], [2e3], [1.0], back=[THIRD]),
    "lead-lag": pt.control.LeadLag(kp=1e5 * THIRD, lead=0.01, lag=0.1, method="matched"),
    "sliding mode": SLIDING,
    "disturbance observer": pt.control.DisturbanceObserver(
        pid=PID, plant_gain=1.5e-6 * THIRD, cutoff=math.inf, plant_time=THIRD
    ),
    "perturbation": pt.control.PerturbationEstimator(
        sliding=SLIDING, plant_gain=1.5e-6 * THIRD, cutoff=1.0
    ),
    "scheduled": pt.control.ScheduledPid(
        amplitudes=[10e-6 * THIRD, 1e-5], rates=[0.1, THIRD], gains=[PID, PID, PID, PID]
    ),
    "hysteresis observer": pt.control.HysteresisObserver(
        stage=pt.DahlStage.xu_li_2010(), pid=PID, correction=THIRD, stroke=1e-4 * THIRD
    ),
    "Bouc-Wen observer": pt.control.HysteresisObserver(
        stage=pt.BoucWenStage(
            mass=0.1, damping=100.0, stiffness=1e5, piezo_coefficient=1.6e-6, alpha=0.36,
            beta=0.04, gamma=0.03,
        ),
        pid=PID,
    ),
}  # fmt: skip
LEARNERS = {
    "lag": pt.Repetitive(period=5 * THIRD, kq=1e6 * THIRD, lead=2, pause=False),
    "compensated lag": pt.Repetitive.from_um(
        period=5.0, smoothing=pt.control.Lag(tq=0.1 * THIRD, compensated=True)
    ),
    "zero phase": pt.Repetitive(
        period=5.0, smoothing=pt.control.ZeroPhase(order=3), forgetting_factor=0.9 * THIRD
    ),
    "no filter": pt.Repetitive(period=5.0, smoothing=None),
}


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def loop(**parts: Any) -> pt.Controller:
    return pt.Controller(**{"dt": 0.01 * THIRD, "limits": (-THIRD, 75.0), **parts})


def back(controller: pt.Controller) -> pt.Controller:
    return pt.load_controller(controller.save("loop.json"))


def commands(controller: pt.Controller) -> list[float]:
    """What it says along a motion with saturation."""
    session = controller.start()
    places = 20e-6 * np.sin(0.02 * np.arange(800)) + 10e-6
    return [session.step(float(x), 0.4 * float(x)) for x in places]


@pytest.mark.parametrize("name", LAWS)
def test_a_law_comes_back_to_the_last_bit(name: str) -> None:
    law = LAWS[name]
    controller = loop(feedback=law, limits=(-1e3 * THIRD, 1e3))
    other = back(controller)
    if law is not None and not isinstance(law, pt.control.StateSpace):
        assert other.feedback == law
    assert commands(other) == commands(controller)
    # A second turn writes the same file.
    first = Path("loop.json").read_bytes()
    other.save("loop.json")
    assert Path("loop.json").read_bytes() == first


@pytest.mark.parametrize("name", LEARNERS)
def test_a_repetitive_part_comes_back_to_the_last_bit(name: str) -> None:
    controller = loop(feedback=PID, repetitive=LEARNERS[name])
    other = back(controller)
    assert other == controller
    assert commands(other) == commands(controller)


@pytest.mark.parametrize("name", STAGES)
def test_the_inverse_of_every_stage_comes_back(name: str) -> None:
    stage = STAGES[name]
    inverse = pt.Inverse(
        stage=stage, offset=1e-6 * THIRD, delay=0.01 * THIRD, playback="online", settle=3
    )
    one = pt.Controller(dt=1e-3, limits=(0.0, 5.0), feedforward=inverse, span=(-1e-3, 1e-3))
    other = back(one)
    assert other == one
    assert other.provenance is not None
    assert len(other.provenance["model_sha256"]) == 64


def test_the_state_and_filters_and_range_come_back() -> None:
    plays = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=(5.0,), weights=(5e-7,))
    last = plays.simulate(np.linspace(0.0, 20.0 * THIRD, 50), 1e-3).final
    controller = loop(
        feedforward=plays.inverse(initial=last),
        filters=(pt.LowPass(100 * THIRD), pt.Notch(40 * THIRD, width=THIRD, depth=THIRD)),
        span=(-1e-4 * THIRD, 2e-4 * THIRD),
        max_jump=1e-5 * THIRD,
    )
    assert back(controller) == controller
    assert back(loop(max_jump=math.inf)).max_jump == math.inf


def test_a_network_comes_back() -> None:
    network = pt.control.train_network(pt.datasets.dbo_training()[3.0:6.0], units=1, plays=1)
    controller = pt.Controller(dt=0.005, limits=(0.0, 3.6), feedforward=network, span=(-1e-3, 1e-3))
    other = back(controller)
    assert isinstance(other.feedforward, pt.control.NetworkInverse)
    assert commands(other) == commands(controller)


@pytest.mark.parametrize(
    ("unit", "key"), [("V", "kp_V_per_m"), ("m", "kp_m_per_m"), ("N", "kp_N_per_m")]
)
def test_the_unit_of_the_drive_is_in_the_names(unit: str, key: str) -> None:
    controller = pt.Controller(
        dt=1e-3, limits=(0.0, 1e-5), feedback=pt.Pid(kp=0.5, ti=0.1), drive_unit=unit
    )
    assert back(controller) == controller
    document = json.loads(Path("loop.json").read_text(encoding="utf-8"))
    assert document["feedback"][key] == 0.5
    assert document[f"limits_{unit}"] == [0.0, 1e-5]


# Where it comes from.


def test_margins_at_design_are_kept() -> None:
    stage = pt.VirtualStage.xu_li_2010()
    controller = pt.Controller(
        dt=0.02, limits=(0.0, 75.0), feedback=pt.Pid.from_um(kp=0.05, ti=0.02)
    )
    report = pt.check_loop(stage, controller)
    other = pt.load_controller(controller.save("loop.json", report=report))
    assert other.provenance is not None
    design = other.provenance["design"]
    assert design["by"] == "check_loop"
    assert 10.0 ** (design["high"]["gain_margin_dB"] / 20.0) == pytest.approx(
        report.high.gain_margin
    )
    assert design["low"]["plant_gain_m_per_V"] == report.low.gain
    assert other.provenance["version"] == pt.__version__
    # They go with the controller, but not with a changed one.
    again = pt.load_controller(other.save("again.json"))
    assert again.provenance == other.provenance
    with pytest.raises(ParameterError, match="report is of another controller"):
        loop().save("other.json", report=report)
    with pytest.raises(ParameterError, match=r"report is .*: expected what"):
        controller.save("other.json", report=3)  # type: ignore[arg-type]
    assert not Path("other.json").exists()


def test_what_a_search_kept_is_kept() -> None:
    tuned = pt.tune(
        pt.VirtualStage.xu_li_2010(), dt=0.02, limits=(0.0, 75.0), parts=["pid"],
        search=pt.TuningSearch(particles=6, iterations=3),
    )  # fmt: skip
    other = pt.load_controller(tuned.controller.save("loop.json", report=tuned))
    assert other.provenance is not None
    kept = {one["name"]: one["value"] for one in other.provenance["design"]["kept"]}
    factors = {one.name: one.value for one in tuned.kept}
    assert kept["gain_margin_dB"] == pytest.approx(20.0 * math.log10(factors["gain margin"]))
    assert kept["gain_margin_dB"] >= 6.02
    assert kept["phase_margin_deg"] == pytest.approx(math.degrees(factors["phase margin"]))
    assert other == tuned.controller


# What is refused.


def changed(change: Callable[[dict[str, Any]], object]) -> str:
    """The sentence about a file in which something was changed."""
    loop(
        feedback=PID,
        feedforward=pt.DahlStage.xu_li_2010().inverse(),
        repetitive=LEARNERS["lag"],
        filters=[pt.LowPass(10.0)],
    ).save("loop.json")
    document = json.loads(Path("loop.json").read_text(encoding="utf-8"))
    change(document)
    Path("loop.json").write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(DataError) as raised:
        pt.load_controller("loop.json")
    return str(raised.value)


def renamed(part: str, old: str, new: str) -> Callable[[dict[str, Any]], object]:
    return lambda d: d[part].update({new: d[part].pop(old)})


REFUSED: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "unit": (renamed("feedback", "kp_V_per_m", "kp_V_per_um"),
             "feedback: 'kp_V_per_um' is 33333.33333333333: expected 'kp_V_per_m'"),
    "key": (lambda d: d.update(gain=3), "loop.json: 'gain' is 3: expected"),
    "missing": (lambda d: d.pop("span_m"), "loop.json: 'span_m' is missing"),
    "version": (lambda d: d.update(schema_version=2), "schema_version is 2: expected 1"),
    "no version": (lambda d: d.update(schema_version=True), "schema_version is True: expected 1"),
    "format": (lambda d: d.update(format="piezotrack-model"), "is not a piezotrack controller"),
    "kind": (lambda d: d["feedback"].update(kind="pidd"), "feedback: kind is 'pidd': expected"),
    "text": (lambda d: d["feedback"].update(kp_V_per_m="x"),
             "feedback: kp_V_per_m is 'x': expected a number"),
    "range": (lambda d: d["feedback"].update(td_s=-1.0), "feedback: td is -1 s: expected"),
    "truth": (lambda d: d["repetitive"].update(pause=3), "repetitive: pause is 3: expected"),
    "filter": (lambda d: d["filters"][0].update(kind="pid"), "filters[0]: kind is 'pid'"),
    "stage": (lambda d: d["feedforward"]["stage"].update(model="dahll"), "model is 'dahll'"),
    "parameter's unit": (
        lambda d: d["feedforward"]["stage"]["parameters"]["mass"].update(unit="g"),
        "the unit of mass is 'g': expected 'kg'",
    ),
    "hash": (
        lambda d: d["feedforward"]["stage"]["parameters"]["mass"].update(value=0.3),
        "provenance: model_sha256 is",
    ),
    "limits": (lambda d: d.update({"limits_V": [75.0, 0.0]}), "limits are (75, 0) V: expected"),
    "drive": (lambda d: d.update(drive_unit="mV"), "drive_unit is 'mV': expected 'V', 'm' or 'N'"),
    "rate": (lambda d: d.update(dt_s=None), "dt_s is None: expected"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_that_is_not_right_is_refused(name: str) -> None:
    change, sentence = REFUSED[name]
    message = changed(change)
    assert message.startswith("loop.json")
    assert message.count("loop.json") == 1
    assert sentence in message
    assert "\n" not in message


def test_other_files_are_refused() -> None:
    for content, words in (
        ("[]", "is not a piezotrack controller"),
        ("{", "loop.json:1: not JSON"),
    ):
        Path("loop.json").write_text(content, encoding="utf-8")
        with pytest.raises(DataError, match=words):
            pt.load_controller("loop.json")
    with pytest.raises(DataError, match=r"gone\.json: there is no such file in"):
        pt.load_controller("gone.json")
