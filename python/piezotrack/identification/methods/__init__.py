"""Methods of a search, as settings."""
