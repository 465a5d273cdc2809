"""Models side by side on one record."""
