"""Closed loops: tracking, contouring, stability, and what is checked before."""
