"""
Margins of a loop
=================

The open loop and the sensitivity of a PI feedback, at the middle gain that the hysteresis gives the
stage, and the margins at all of them.
"""

import piezotrack as pt

fit = pt.identify(pt.datasets.dbo_training()[3.0:13.0], "prandtl-ishlinskii")
loop = pt.Controller.of(fit, feedback=pt.Pid.from_um(kp=0.03, ti=0.02))
report = pt.check_loop(fit, loop, delay=0.002)
print(report)

# %%
# Magnitude and phase of the open loop; sensitivity and closed loop.

report.plot()
