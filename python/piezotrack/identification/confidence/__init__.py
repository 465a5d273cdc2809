"""Confidence in a model, and the drive that raises it."""
