"""The drive that determines the values of a model best."""
