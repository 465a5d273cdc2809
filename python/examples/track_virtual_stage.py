"""The experiments of Figs. 12 to 14 of Xu and Li 2010 on the virtual stage.

Identifies a Dahl model as in the paper, runs each experiment, prints a table and writes a
picture of each: ``python track_virtual_stage.py [FOLDER]``.
"""

import math
import sys
from pathlib import Path

import numpy as np

import piezotrack as pt

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "tracking")
folder.mkdir(parents=True, exist_ok=True)
stage = pt.VirtualStage.xu_li_2010(seed=1)

# The paper's record: 0.25 Hz, 0 to 75 V, 5 kHz; the first 4 s are fitted.
dt = 1 / 5000.0
t = np.arange(60001) * dt
log = stage.record(37.5 * (1.0 - np.cos(2.0 * np.pi * 0.25 * t)), dt)
fit = pt.identify(
    log[0:4.0],
    "dahl",
    parameters={
        "mass": (0.1, 0.2),
        "damping": (1000.0, 5000.0),
        "stiffness": (1e4, 5e4),
        "piezo_coefficient": (0.01, 0.1),
        "a1": 121.9874,
        "a2": 1.1773e6,
        "b1": 1.8485e6,
    },
    method=pt.Descents(seed=1),
)
print(f"model: {fit.score(log[4.0:])} on the 8 s that were not fitted\n")

pid = pt.Pid.xu_li_2010()
slow = pt.sine(frequency=0.2, low=0.0, high=110e-6, duration=20.0)
small = pt.sine(frequency=0.2, low=8e-6, high=39e-6, duration=20.0)
fast = pt.sine(frequency=0.5, low=0.0, high=110e-6, duration=20.0)


def run(name, reference, limits=(0.0, 75.0), **parts):
    """Track a reference, keep a picture, return the run."""
    loop = pt.Controller(dt=0.02, limits=limits, **parts)
    result = pt.track(stage, loop, reference, beyond_reach=limits != (0.0, 75.0))
    result.plot().savefig(folder / f"{name}.png", dpi=150)
    return result


both = {"feedforward": fit.inverse(), "feedback": pid}
unwound = {
    "feedforward": fit.inverse(),
    "feedback": pt.Pid.from_um(kp=0.120, ti=0.009, td=0.044, tt=math.inf),
}
runs = {
    "Fig. 12, feedforward alone": run("fig12_feedforward", slow, feedforward=fit.inverse()),
    "Fig. 12, PID alone": run("fig12_pid", slow, feedback=pid),
    "Fig. 12, both": run("fig12_both", slow, **both),
    "Fig. 13, within the limits": run("fig13_free", small, **both),
    "Fig. 13, 6 to 28 V, no antiwindup": run("fig13_windup", small, (6.0, 28.0), **unwound),
    "Fig. 13, 6 to 28 V, antiwindup": run("fig13_antiwindup", small, (6.0, 28.0), **both),
    "Fig. 14, 0.5 Hz": run("fig14_both", fast, **both),
    "Fig. 14, repetitive": run(
        "fig14_repetitive",
        fast,
        **both,
        repetitive=pt.Repetitive.from_um(period=2.0, tq=0.2, kq=1.0),
    ),
}
published = {
    "Fig. 12, feedforward alone": "max 5.69",
    "Fig. 12, PID alone": "max 4.44, 0.063 rad, 6.24 %",
    "Fig. 12, both": "within 1.5, 0.006 rad, 1.76 %",
    "Fig. 13, within the limits": "max about 1.06",
    "Fig. 13, 6 to 28 V, no antiwindup": "max 6.35",
    "Fig. 13, 6 to 28 V, antiwindup": "clearly better",
    "Fig. 14, 0.5 Hz": "max 2.29",
    "Fig. 14, repetitive": "within 1.5 from the fourth period on",
}
print("| situation | published, um | max, um | rms, um | lag, rad | loop, % | max by period, um |")
print("| --- | --- | --- | --- | --- | --- | --- |")
for name, result in runs.items():
    m = result.metrics
    periods = " ".join(f"{1e6 * one.max_error:.2f}" for one in result.periods[:5])
    print(
        f"| {name} | {published[name]} | {1e6 * m.max_error:.2f} | {1e6 * m.rms_error:.2f} "
        f"| {m.phase_lag:.4f} | {100 * m.widest_loop:.2f} | {periods} |"
    )
