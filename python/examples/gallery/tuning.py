"""
Tune the gains
==============

Gains of a PI feedback by hand, and those that `tune` finds under a gain margin of 6 dB, a phase
margin of 29 degrees and a sensitivity of at most 2.
"""

import matplotlib.pyplot as plt

import piezotrack as pt

log = pt.datasets.dbo_training().zeroed()
fit = pt.identify(log[3.0:13.0], "prandtl-ishlinskii")
stage = pt.VirtualStage.of(fit, noise=65e-9, delay=2e-3, seed=1)
triangle = pt.triangle(frequency=1.0, low=5e-6, high=42e-6, duration=3.0)
by_hand = pt.Controller.of(fit, feedback=pt.Pid.from_um(kp=0.03, ti=0.02))
tuned = pt.tune(
    stage,
    triangle,
    dt=fit.data.dt,
    limits=fit.drive_range,
    feedforward=fit.inverse(),
    search=pt.TuningSearch(particles=16, iterations=10),
)
print(tuned)

# %%
# Both on the same stage:

fig, ax = plt.subplots(figsize=(8, 3.5), layout="constrained")
for name, loop in {"by hand": by_hand, "tuned": tuned.controller}.items():
    run = pt.track(stage, loop, triangle)
    rms = 1e9 * run.metrics.rms_error
    ax.plot(run.t, 1e6 * run.error, lw=1, label=f"{name}, {rms:.0f} nm rms")
ax.set(xlabel="time [s]", ylabel="desired less measured [µm]", ylim=(-1.0, 1.0))
ax.legend()
