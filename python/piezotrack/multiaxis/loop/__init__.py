"""Decoupling of several axes, loops around them, and their references."""
