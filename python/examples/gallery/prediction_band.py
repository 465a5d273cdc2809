"""
The band of a prediction
========================

How far a reading may be from the model, on a log that was not fitted: noise, parameters and error
of the model.
"""

import piezotrack as pt

log, other = pt.datasets.dbo_training(), pt.datasets.dbo_tracking()
fit = pt.identify(log[3.0:13.0], "prandtl-ishlinskii")
band = fit.prediction_band(other[30.0:34.0])
print(f"{100 * band.coverage:.0f} % of the readings are in the band")

# %%
# The lowest panel shows the parts of the half width.

band.plot()
