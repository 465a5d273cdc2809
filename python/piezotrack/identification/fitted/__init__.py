"""Identified models: a stage with what belongs to its records, its score, and its file."""
