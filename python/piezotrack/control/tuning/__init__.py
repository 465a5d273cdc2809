"""Search for gains under margins, and other designs of a law."""
