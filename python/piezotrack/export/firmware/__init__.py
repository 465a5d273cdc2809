"""A controller as firmware: a project that builds for a board and for this computer."""
