"""Models whose hysteresis acts on the displacement, in feedback: friction."""
