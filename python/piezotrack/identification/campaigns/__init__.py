"""Identifications of many records, by an executor."""
