"""
Where the error of a model comes from
=====================================

The residual of a fit, apart as noise, as what repeats with the drive, and as what depends on the
voltage, the rate or the time.
"""

import piezotrack as pt

log = pt.datasets.dbo_training()
fit = pt.identify(log[3.0:8.0], "prandtl-ishlinskii")
print(pt.identification.residual_of(fit))
fit.plot_residual()
