"""
Learn the line of a raster
==========================

A line at 20 Hz, repeated. What repeats in the error is learnt from trial to trial, until only noise
is left.
"""

import piezotrack as pt

plays = pt.PrandtlIshlinskiiStage(
    linear=0.8e-6, thresholds=(2.0, 6.0, 12.0, 20.0, 30.0), weights=(5e-8,) * 5
)
stage = pt.VirtualStage.of(plays, noise=5e-9, delay=2e-4, mode=(400.0, 0.05), seed=1)
log = pt.measure(
    pt.hardware.VirtualDevice(stage, limits=(0.0, 75.0)), "decaying:5Hz,0..75V", rate=1e4
)
fit = pt.identify(log, "prandtl-ishlinskii", delay=2e-4)
line = pt.triangle(frequency=20.0, low=10e-6, high=50e-6, duration=0.2, rounding=0.2)
loop = pt.Controller.of(fit, limits=(0.0, 75.0))
found = pt.learn(stage, line, loop, model=fit, cutoff=200.0)
print(found.summary())

# %%
# The error of the first and of the best trial, the voltage that was learnt, and the error of all
# trials.

found.plot()
