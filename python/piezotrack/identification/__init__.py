"""From a record to a model.

Swarm search, least squares, step response, sensor noise, cross-talk, the comparison of models and
the model files; tables and pictures stand beside their results.
"""
