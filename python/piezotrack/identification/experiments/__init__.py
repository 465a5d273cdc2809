"""Experiments that are read directly: steps, a sensor at rest, cross-talk."""
