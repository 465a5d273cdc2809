"""Controllers: their parts, their session, their file."""
