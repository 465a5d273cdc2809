"""The benchmark of models: models times records, one result each, and the board of them."""
