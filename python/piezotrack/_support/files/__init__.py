"""Files: atomic writing of several at once, what a killed run leaves behind, and JSON."""
