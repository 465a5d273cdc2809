"""A controller that calls the C library of piezotrack."""
