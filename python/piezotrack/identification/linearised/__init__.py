"""Values of an identified model that were fitted, and their effect on the motion of a record."""
