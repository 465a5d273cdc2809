"""
Frequency and damping from a step
=================================

Steady state, overshoot and period of a recorded step give the mode, as in section 3 of Xu and Li
2010.
"""

import numpy as np

import piezotrack as pt

drive = np.where(np.arange(1600) < 100, 0.0, 75.0)
log = pt.VirtualStage.xu_li_2010(seed=1).record(drive, 2e-4, hold="zoh")
step = pt.identify_step(log)
print(step.summary())

# %%
# The peaks that were read, and the resonance in the spectrum.

step.plot()
