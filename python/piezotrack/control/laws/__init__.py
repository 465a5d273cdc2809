"""Feedback laws, repetitive control, filters, and their form in a file."""
