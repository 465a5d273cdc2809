"""
From a log to a controller
==========================

A model fitted to 10 s of a measured log becomes the feedforward of a controller, which is tried in
simulation on a model of another log, with the noise of the sensor. Displacements count from the
beginning of each log: `zeroed`.
"""

import piezotrack as pt

log = pt.datasets.dbo_training().zeroed()
other = pt.datasets.dbo_tracking().zeroed()
fit = pt.identify(log[3.0:13.0], "asymmetric-prandtl-ishlinskii")
print("on the other log:", fit.score(other[3.0:]))

# %%
# The controller: inverse of the model as feedforward, and a PI feedback. Gains in V/µm and s.

loop = pt.Controller.of(fit, feedback=pt.Pid.from_um(kp=0.03, ti=0.02))
triangle = pt.triangle(frequency=1.0, low=5e-6, high=42e-6, duration=4.0)

# %%
# A stage that is its own model would flatter the controller: another model, from the other log,
# stands for it.

stage = pt.VirtualStage.of(pt.identify(other[3.0:13.0], "prandtl-ishlinskii"), noise=65e-9, seed=1)
run = pt.track(stage, loop, triangle)
print(run.metrics)
run.plot()

# %%
# On the hardware, one call for each sample: reference and reading in µm, voltage out.

session = loop.start()
print(session.step_um(10.0, 9.8))
