"""How sure an identification is: sensitivities and the covariance of what was fitted."""
