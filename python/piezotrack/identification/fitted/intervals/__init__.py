"""Intervals of confidence from profiles and refits."""
