"""Controllers side by side on one stage."""
