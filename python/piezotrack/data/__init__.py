"""Records of drive and displacement.

The data set, its reader and columns, resampling, and diagnostics of what a record is good for.
"""
