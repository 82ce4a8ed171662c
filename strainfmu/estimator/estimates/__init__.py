"""Estimates of loads and of surface pressure, with every number by name, and how they are shown."""
