"""Tables and pictures of how sure a model is."""
