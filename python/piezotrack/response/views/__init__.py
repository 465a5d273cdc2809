"""Texts and pictures of a frequency response."""
