"""The map of the nonlinear estimator: tables over the flight state, and how far pressure may be off them."""
