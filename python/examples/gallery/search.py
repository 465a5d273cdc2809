"""
A search and its descents
=========================

A first-order Dahl model is found by descents from random points. Where many of them end at one
cost, it is likely to be the lowest.
"""

import piezotrack as pt

log = pt.datasets.dbo_training()
fit = pt.identify(log[3.0:5.0], "first-order-dahl", method=pt.Descents(seed=1, runs=8))
print(f"{fit.search.agreeing_runs} of {len(fit.search.runs)} descents agree")

# %%
# The lowest costs over the iterations, and where each descent ended.

fit.plot_convergence()
