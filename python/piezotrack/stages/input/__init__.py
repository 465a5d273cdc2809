"""Bouc-Wen models at the input, before linear mechanics."""
