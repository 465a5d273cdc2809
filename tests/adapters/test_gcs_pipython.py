"""PIPython, the client that Physik Instrumente publishes, in front of our virtual controller.

It runs in a process of its own: it closes its socket a second time when Python collects it.
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import piezotrack as pt
from gcs_peers import LIMITS, quiet_stage
from piezotrack.hardware import GcsServer

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("pipython") is None,
    reason="PIPython is not installed: pip install PIPython",
)

HEAD = """
import json, sys, time
from pipython import GCSDevice, GCSError, datarectools, pitools
from pipython.pidevice.interfaces.pisocket import PISocket

gate = PISocket("127.0.0.1", int(sys.argv[1]))
# It asks for a parameter that there is not, and waits for an answer.
gate.settimeout(3000)
pi = GCSDevice(gateway=gate)
found = {}

def refused(call, *arguments):
    try:
        call(*arguments)
    except GCSError as error:
        return error.val
    return 0
"""
TAIL = """
found["left"] = pi.qERR()
print(json.dumps(found))
pi.close()
"""


def printed_by(body: str, speed: float = 20.0) -> dict[str, Any]:
    """What a script says that uses PIPython."""
    with GcsServer(quiet_stage(), speed=speed) as server:
        done = subprocess.run(
            [sys.executable, "-c", HEAD + body + TAIL, str(server.port)],
            capture_output=True,
            text=True,
            timeout=120.0,
            check=False,
        )
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    # Nothing that it has sent was refused without its noticing.
    assert answer.pop("left") == 0
    return answer


@pytest.mark.slow
def test_it_takes_the_controller_for_one_of_gcs_2() -> None:
    answer = printed_by("""
found["kind"] = type(pi.gcsdevice).__name__
found["axes"] = pi.axes
found["name"] = pi.qIDN()
found["version"] = pi.qCSV()
found["ready"] = pi.IsControllerReady()
found["functions"] = pi.funcs
found["servo"] = pi.qSPA("1", 0x0E000200)["1"][0x0E000200]
found["points"] = datarectools.Datarecorder(pi).maxnumvalues
""")
    assert answer["kind"] == "GCS2Device"
    assert answer["axes"] == ["1"]
    assert answer["version"] == 2.0
    assert answer["ready"] is True
    assert answer["servo"] == 50e-6
    assert answer["points"] == 65536
    assert answer["name"].startswith("(c) piezotrack")
    assert {"MOV", "SVA", "WAV", "WGO", "qDRR", "StopAll", "IsGeneratorRunning"} <= set(
        answer["functions"]
    )


def test_it_drives_the_axis_in_open_and_closed_loop() -> None:
    answer = printed_by("""
pi.SVO("1", False)
pi.SVA("1", 30.0)
found["servo"] = pi.qSVO("1")["1"]
found["volts"] = pi.qVOL(1)[1], pi.qSVA("1")["1"]
found["limits"] = pi.qVMI(1)[1], pi.qVMA(1)[1]
found["travel"] = pi.qTMN("1")["1"], pi.qTMX("1")["1"]
found["refused"] = refused(pi.SVA, "1", 75.5), refused(pi.MOV, "1", 10.0)
pi.SVO("1", True)
pi.MOV("1", 50.0)
pitools.waitontarget(pi, timeout=60)
found["first"] = pi.qPOS("1")["1"], pi.qMOV("1")["1"]
pi.MVR("1", -20.0)
pitools.waitontarget(pi, timeout=60)
found["second"] = pi.qPOS("1")["1"], pi.qMOV("1")["1"]
found["while on"] = refused(pi.SVA, "1", 5.0), refused(pi.MOV, "1", 1000.0)
found["stop"] = refused(pi.StopAll), refused(pi.STP), refused(pi.HLT)
""")
    assert answer["servo"] is False
    assert answer["volts"] == [30.0, 30.0]
    assert answer["limits"] == list(LIMITS)
    # Voltage out of limits; a move with the servo off.
    assert answer["refused"] == [66, 5]
    near = 0.005 * (answer["travel"][1] - answer["travel"][0])
    for name, target in (("first", 50.0), ("second", 30.0)):
        position, commanded = answer[name]
        assert commanded == target
        assert position == pytest.approx(target, abs=near)
    assert answer["while on"] == [79, 7]
    assert answer["stop"] == [10, 10, 10]


WAVE = 20.0 - 20.0 * np.cos(2.0 * np.pi * np.arange(200) / 200.0)


@pytest.mark.slow
def test_it_plays_a_wave_table_and_reads_the_data_recorder() -> None:
    words = json.dumps([round(float(value), 6) for value in WAVE])
    answer = printed_by(f"""
wave = {words}
pitools.writewavepoints(pi, 1, wave, bunchsize=10)
found["length"] = pi.qWAV(1, 1)[1][1]
pi.qGWD(1, 1, len(wave))
while pi.bufstate is not True:
    time.sleep(0.01)
found["back"] = pi.bufdata[0]
pi.WSL(1, 1)
pi.WGC(1, 3)
pi.WTR(1, 10, 0)
recorder = datarectools.Datarecorder(pi)
recorder.numvalues = 600
recorder.samplefreq = 2000.0
recorder.options = (2, 7)
recorder.sources = ("1", "1")
recorder.trigsources = datarectools.TriggerSources.DEFAULT_0
recorder.arm()
pi.WGO(1, 1)
header, data = recorder.getdata(timeout=60)
pitools.waitonwavegen(pi, timeout=60)
found["runs"] = pi.IsGeneratorRunning(1)[1]
found["interval"] = header["SAMPLE_TIME"]
found["position"], found["volts"] = data
""")
    assert answer["length"] == 200.0
    np.testing.assert_allclose(answer["back"], WAVE, atol=1e-6)
    assert answer["runs"] is False
    assert answer["interval"] == 0.0005
    np.testing.assert_allclose(answer["volts"], np.tile(WAVE, 3), atol=1e-6)
    device = pt.hardware.VirtualDevice(quiet_stage(), limits=LIMITS)
    table = np.tile([round(float(value), 6) for value in WAVE], 3)
    record = device.play(table, 2000.0)
    np.testing.assert_allclose(answer["position"], 1e6 * record.displacement, atol=1e-5)


@pytest.mark.slow
def test_it_defines_waves_and_records_a_step() -> None:
    answer = printed_by(
        """
pi.WAV_LIN(2, 0, 100, "X", 10, 30.0, 5.0, 100)
pi.WAV_RAMP(3, 0, 200, "X", 100, 10, 30.0, 0.0, 200)
pi.WAV_SIN_P(4, 0, 200, "X", 100, 30.0, 0.0, 200)
found["lengths"] = [pi.qWAV(k, 1)[k][1] for k in (2, 3, 4)]
pi.TWC()
pi.WCL([2, 3])
found["cleared"] = [pi.qWAV(k, 1)[k][1] for k in (2, 3, 4)]
recorder = datarectools.Datarecorder(pi)
recorder.numvalues = 400
recorder.samplefreq = 2000.0
recorder.trigsources = datarectools.TriggerSources.NEXT_COMMAND_WITH_RESET_2
recorder.arm()
pi.SVA("1", 40.0)
header, data = recorder.getdata(timeout=60)
found["step"] = data[0]
""",
        speed=1.0,
    )
    assert answer["lengths"] == [100.0, 200.0, 200.0]
    assert answer["cleared"] == [0.0, 0.0, 200.0]
    # The stage's mode: the first peak is half a period after the step, at 160 Hz.
    step = np.array(answer["step"])
    assert pytest.approx(0.5 * int(np.argmax(step[:20])), abs=1.01) == 1e3 * 0.5 / 160.0
    assert step[-1] == pytest.approx(step[-100:].mean(), rel=1e-3)
