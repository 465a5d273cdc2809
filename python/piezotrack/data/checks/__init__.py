"""Checks of a record: wrong connections, readings far off, hum, and what it cannot show."""
