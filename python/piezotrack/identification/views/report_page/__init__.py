"""The report of a stage for readers who do not know the package."""
