"""
Where the error of a model comes from
=====================================

The residual of a fit over time, voltage, rate and amplitude, and the cause that explains most of
it.
"""

import piezotrack as pt

log = pt.datasets.dbo_training()
fit = pt.identify(log[3.0:8.0], "prandtl-ishlinskii")
print(pt.identification.residual_of(fit))

# %%
# Of white residuals the last panel, the autocorrelation, would stay within its lines.

fit.plot_residual()
