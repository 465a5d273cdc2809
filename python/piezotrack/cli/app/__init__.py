"""The command that opens the page in the browser."""
