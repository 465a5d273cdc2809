"""Runs along a reference, simulated or on a device."""
