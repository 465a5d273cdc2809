"""Variants of a fit, tried beside it: a drive interpolated, another exponent."""
