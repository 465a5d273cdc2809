"""Memory that cannot be had is a MemoryError with its size, and no end of the process."""

from __future__ import annotations

import re
import sys

import pytest

from children import child

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="the limit of memory is that of Linux"
)

PREPARED = """
import dataclasses
reference = pt.sine(frequency=1.0, low=0.0, high=5e-5, duration=100.0)
loop = pt.Controller(dt=1e-4, limits=(0.0, 75.0), feedback=pt.Pid.from_um(kp=0.01, ti=0.1, td=0.0))
repetitive = pt.Controller(dt=1e-6, limits=(0.0, 75.0), repetitive=pt.Repetitive(period=9.9))
stage = pt.DahlStage.xu_li_2010()
plays = pt.PrandtlIshlinskiiStage(linear=1e-6, thresholds=[5.0], weights=[1e-7])
virtual = pt.VirtualStage.xu_li_2010()
xy = pt.XYStage.xu_li_2010()
circle = pt.circle(frequency=0.1, radius=1e-5)
figure = pt.lissajous(frequencies=(0.2, 0.3), sizes=(2e-5, 2e-5))
few = np.broadcast_to(1.0, (1000,))
many = np.broadcast_to(1.0, (30_000_000,))
t = np.arange(2000) / 1000.0
u = 30.0 * (1.0 - np.cos(2.0 * np.pi * t))
log = pt.Dataset(u=u, y=stage.simulate(u, 0.001).x, dt=0.001)
swarm = pt.ParticleSwarm(particles=100_000)
long = pt.Dataset(u=np.tile(u, 500), y=np.tile(log.y, 500), dt=0.001)
try:
    {call}
except (MemoryError, OSError, pt.PiezotrackError) as error:
    print(type(error).__name__, error)
assert stage.simulate(few, 0.01).x.size == 1000
"""

NONE = {
    "dahl": "stage.simulate(many, 0.01)",
    "rk4": "stage.simulate(many, 1e-5, method='rk4')",
    "plays": "plays.simulate(many, 0.01)",
    "virtual": "virtual.simulate(many, 0.01)",
    "both axes": "xy.simulate(many, many, 0.01)",
    "inverse": "stage.inverse()._begun(0.01).along(many, many, many)",
    "delay line": "[repetitive.start() for _ in range(10)]",
    "loop": "pt.track(stage, loop, reference, substeps=90)",
    "circle": "circle.errors(many, many)",
    "path": "figure.errors(many, many)",
    "swarm": "pt.identify(log, 'dahl', method=dataclasses.replace(swarm, runs=10))",
    "refinement": "pt.identify(long, 'dahl', threads=16)",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", NONE)
def test_no_memory_is_an_exception_and_the_process_goes_on(name: str) -> None:
    ended = child(PREPARED.format(call=NONE[name]), room=600_000_000)
    assert (ended.returncode, ended.stderr) == (0, "")
    # NumPy's sentence where it is an array of its own that has no room.
    pattern = (
        r"MemoryError ([a-z]\D*: \d+ MB of memory cannot be allocated|Unable to allocate .*)\n"
    )
    # The stacks of threads need memory too.
    pattern += "|OSError no threads could be started: .*\n"
    assert re.fullmatch(pattern, ended.stdout), ended.stdout


TOO_MANY = {
    "samples": (
        "stage.simulate(np.broadcast_to(1.0, (10**11,)), 0.01)",
        "ShapeError u has 100000000000 samples: expected 500000000 at most",
    ),
    "points": (
        "circle.errors(np.broadcast_to(1.0, (10**9,)), few)",
        "ShapeError x has 1000000000 samples: expected 500000000 at most",
    ),
    "instants": (
        "pt.track(stage, loop, reference, substeps=19_000_000)",
        "ParameterError substeps is 19000000: expected 1 to 100000",
    ),
    "period": (
        "pt.Controller(dt=1e-6, limits=(0.0, 75.0), repetitive=pt.Repetitive(period=990))",
        "ParameterError period is 990 s: expected from 2 to 1e7 sampling intervals",
    ),
    "particles": (
        "pt.identify(log, 'dahl', method=dataclasses.replace(swarm, runs=10_000))",
        "ParameterError runs is 10000: expected 10 at most, with 100000 particles in each: "
        "1000000 in all",
    ),
}


@pytest.mark.parametrize("name", TOO_MANY)
def test_sizes_beyond_any_use_are_refused_before_memory_is_asked_for(name: str) -> None:
    call, sentence = TOO_MANY[name]
    ended = child(PREPARED.format(call=call), room=600_000_000)
    assert (ended.returncode, ended.stderr, ended.stdout) == (0, "", sentence + "\n")
