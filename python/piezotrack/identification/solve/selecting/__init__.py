"""Selection of a model: trials on first parts of records, then fits to the whole."""
