"""A page of words, tables and pictures, as one HTML or PDF file."""
