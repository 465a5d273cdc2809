"""Helpers that know no stage model.

Checks of arguments and arrays, units, files, statistics, the progress bar and the plot style.
"""
