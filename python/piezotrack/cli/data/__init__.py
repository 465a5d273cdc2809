"""Commands on logs: contents, other formats, noise."""
