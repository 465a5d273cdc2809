"""Text formats of logs: delimited columns, and texts with headers."""
