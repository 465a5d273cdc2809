"""Experiments of the paper, one file a figure, with its procedure and its references."""
