"""Commands that show the package at work: the demonstration, and the paper."""
