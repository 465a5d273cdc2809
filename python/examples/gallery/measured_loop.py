"""
A measured loop and its model
=============================

The loop of a piezo stack, the fit, and its error over time.
"""

import piezotrack as pt

log = pt.datasets.dbo_training()
fit = pt.identify(log[3.0:13.0], "asymmetric-prandtl-ishlinskii")
print(fit.summary())

# %%
# The loop, displacement over time, and the error with the band in which 95 % of it are expected.

fit.plot()
