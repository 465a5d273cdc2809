"""Pictures and tables of controllers and their runs."""
