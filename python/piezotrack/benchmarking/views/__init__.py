"""Picture and table of the benchmark."""
