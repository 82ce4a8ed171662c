"""Strain gauges and auxiliary sensors: where they are and in which direction they read."""
