"""How sure an identification is, and what to measure next."""
