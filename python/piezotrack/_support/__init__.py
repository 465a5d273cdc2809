"""Helpers that are independent of any stage model.

Checks of arguments and arrays, units, files, statistics, the progress bar, the plot style, and the
loader of the public names.
"""
