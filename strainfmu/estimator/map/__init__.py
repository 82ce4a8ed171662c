"""The map and what is computed from it alone: noise, gains, covariances, temperature modes, validity."""
