"""
Compare models
==============

Four models are fitted to one part of a log and compared on another log.
"""

import piezotrack as pt

log, other = pt.datasets.dbo_training(), pt.datasets.dbo_tracking()
models = ["asymmetric-prandtl-ishlinskii", "preisach", "prandtl-ishlinskii", "duhem"]
found = pt.compare(log, models, train=(3.0, 13.0), test=other[3.0:23.0])
print(found.summary())

# %%
# Loops, errors over time, and the error of each model on what was fitted and on what was not.

found.plot()
