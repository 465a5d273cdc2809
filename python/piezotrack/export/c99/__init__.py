"""Controllers in C99: their parts, their sources, and a program that checks them."""
