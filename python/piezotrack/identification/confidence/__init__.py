"""How sure a model is, and what a further record would tell."""
