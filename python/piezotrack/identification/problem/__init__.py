"""Problem of an identification: records, parameters, objective, checkpoint."""
