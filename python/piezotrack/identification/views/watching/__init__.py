"""Views of what has changed of a stage."""
