"""Learning from trial to trial."""
