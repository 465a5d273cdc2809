"""The residual of a fit, and the ingredient that explains it."""
