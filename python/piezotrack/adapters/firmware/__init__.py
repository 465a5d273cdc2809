"""Boards with a firmware of this package: their line, and the device."""
