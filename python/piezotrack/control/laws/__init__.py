"""Feedback laws, and a neural network as feedforward."""
