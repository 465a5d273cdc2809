"""How sure a result is: the covariance of its values, and bands of predictions."""
