"""Texts and pictures of stages of several axes."""
