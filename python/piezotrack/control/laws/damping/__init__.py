"""Laws that damp the first mode by a filter of the measurement."""
