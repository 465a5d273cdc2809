"""Identification in Xu and Li 2010, section 3.3: free parameters, bounds and record."""

__all__ = ["FITTED_SECONDS", "SEARCH_BOX"]

# Bounds of the free parameters, SI.
SEARCH_BOX = {
    "mass": (0.1, 0.2),
    "damping": (1000.0, 5000.0),
    "stiffness": (1e4, 5e4),
    "piezo_coefficient": (0.01, 0.1),
}
FITTED_SECONDS = 4.0
