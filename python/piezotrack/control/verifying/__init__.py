"""Verification of a loop: its sensitivity measured beside the one predicted."""
