"""Commands on logs: what they hold, and other formats."""
