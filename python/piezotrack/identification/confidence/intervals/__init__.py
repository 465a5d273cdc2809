"""Intervals of confidence from profiles and refits, about a fit."""
