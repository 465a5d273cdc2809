"""Models of relays and branches at the input: Preisach and Duhem."""
