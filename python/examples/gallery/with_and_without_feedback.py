"""
With and without feedback
=========================

A triangle of 37 µm: with the inverse of the model alone, whose error is a constant offset for the
most part, and with a PI feedback as well.
"""

import matplotlib.pyplot as plt

import piezotrack as pt

log = pt.datasets.dbo_training().zeroed()
other = pt.datasets.dbo_tracking().zeroed()
fit = pt.identify(log[3.0:13.0], "asymmetric-prandtl-ishlinskii")
stage = pt.VirtualStage.of(pt.identify(other[3.0:13.0], "prandtl-ishlinskii"), noise=65e-9, seed=1)
triangle = pt.triangle(frequency=1.0, low=5e-6, high=42e-6, duration=3.0)
feedback = pt.Pid.from_um(kp=0.03, ti=0.02)
loops = {
    "feedforward": pt.Controller.of(fit),
    "feedforward and PI": pt.Controller.of(fit, feedback=feedback),
}

# %%
# The error of each, over time.

fig, ax = plt.subplots(figsize=(8, 3.5), layout="constrained")
for name, loop in loops.items():
    run = pt.track(stage, loop, triangle)
    ax.plot(run.t, 1e6 * run.error, label=f"{name}, {1e6 * run.metrics.rms_error:.2f} µm rms")
ax.set(xlabel="time [s]", ylabel="desired less measured [µm]")
ax.legend()
