"""
A circle with two axes
======================

Each axis is a model of a measured log. The contour error is the distance to the path, drawn
magnified.
"""

import piezotrack as pt

logs = pt.datasets.dbo_training(), pt.datasets.dbo_tracking()
x, y = (pt.identify(log.zeroed()[3.0:13.0], "prandtl-ishlinskii") for log in logs)
stage = pt.XYStage(x=x, y=y)
loops = [pt.Controller.of(axis, feedback=pt.Pid.from_um(kp=0.03, ti=0.02)) for axis in (x, y)]
middle = pt.control.workspace(stage, [loop.limits for loop in loops]).centre
run = pt.contour(stage, loops, pt.circle(frequency=1.0, radius=10e-6, centre=middle))
print(run.summary())

# %%
# The path, and the contour error magnified along it and over the angle.

run.plot()
