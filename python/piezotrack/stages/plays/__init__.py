"""Models made of plays at the input: Prandtl-Ishlinskii, its extensions, Maxwell slip."""
