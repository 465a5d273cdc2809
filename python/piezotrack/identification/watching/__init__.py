"""Watching a stage: what a new record of it shows to have changed."""
