"""Parts of a controller: what they have in common, filters, repetitive control, form in a file."""
