"""Solution of a problem: searches, least squares, choice of the model."""
