"""Demonstrations, benchmarks and the experiments of Xu and Li 2010."""
