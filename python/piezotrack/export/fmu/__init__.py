"""Controllers as co-simulation units of FMI 2.0."""
