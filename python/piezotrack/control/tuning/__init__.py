"""Gains that nobody picks by hand."""
