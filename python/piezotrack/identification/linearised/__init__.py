"""What an identified model was fitted with, and how a record changes with it."""
