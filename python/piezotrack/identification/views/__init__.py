"""Pictures and tables of identifications."""
