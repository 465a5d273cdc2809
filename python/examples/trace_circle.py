"""Table 2 of Xu and Li 2010 on the XY virtual stage, and cross-talk identified and decoupled.

Identifies a Dahl model of x as in the paper, uses its inverse as the feedforward of both axes,
runs the nine circles, prints a table and writes pictures: ``python trace_circle.py [FOLDER]``.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import piezotrack as pt
from piezotrack.xu_li_2010.demo import demo_log, identify_demo

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "contouring")
folder.mkdir(parents=True, exist_ok=True)
stage = pt.XYStage.xu_li_2010(seed=1)
pid = pt.Pid.xu_li_2010()
inverse = identify_demo(demo_log(1), seed=1).inverse()
loop = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedforward=inverse, feedback=pid)

table = pt.xu_li_2010.run_table_2(stage, (loop, loop))
print(table)
table.plot().savefig(folder / "table_2.png", dpi=150)
table.runs[0].plot().savefig(folder / "circle_10um_0.1Hz.png", dpi=150)

# Cross-talk ten times as large, identified from two logs: visible with feedforward alone.
stage = replace(stage, cross_talk=(0.10, -0.08), lag=0.0)
t = np.arange(8000) / 1000.0
slow, held = 37.5 * (1.0 - np.cos(2.0 * np.pi * 0.25 * t)), np.zeros(t.size)
found = pt.identification.identify_cross_talk(
    stage.record(slow, held, 1e-3), stage.record(held, slow, 1e-3)
)
print(f"\ncross-talk: {found}")
alone = pt.Controller(dt=0.02, limits=(0.0, 75.0), feedforward=inverse)
path = pt.circle(frequency=0.2, radius=40e-6)
for name, matrix in (("as it is", None), ("decoupled", found.matrix)):
    for parts, controller in (("feedforward alone", alone), ("feedforward and PID", loop)):
        run = pt.contour(stage, (controller, controller), path, decoupling=matrix)
        print(f"{name}, {parts}: SD {1e6 * run.metrics.sd_error:.3f} um")
