"""The vehicle as built from a ground test: what should be read, what does not fit, what the test leaves open."""
