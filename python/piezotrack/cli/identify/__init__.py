"""Commands that make models of a log, and judge them."""
