"""Strain gauges and the sensors beside them: where they are and in which direction they read."""
