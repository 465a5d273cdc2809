"""Helpers that are independent of any stage model.

Checks of arguments and arrays, units, files, statistics, display of results, and the
loader of the public names.
"""
