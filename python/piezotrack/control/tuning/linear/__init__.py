"""Linear systems of python-control, and laws that are designed with them."""
