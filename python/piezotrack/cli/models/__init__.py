"""Commands on models: their identification, comparison and simulation."""
