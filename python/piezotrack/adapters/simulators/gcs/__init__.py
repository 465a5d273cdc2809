"""A virtual controller that speaks GCS, in front of a virtual stage."""
