"""Display of results: text, tables, pictures, progress."""
