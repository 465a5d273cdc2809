"""MethodChoice of a search, as settings."""
