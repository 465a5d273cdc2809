"""The set of models of a tuning: which are simulated, and which plants stand for the others."""
