"""System simulation: the plant's physics, the co-simulation master and what it records."""
