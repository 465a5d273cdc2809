"""``python -m piezotrack`` is the command ``piezotrack``."""

from .cli import main

if __name__ == "__main__":
    main()
