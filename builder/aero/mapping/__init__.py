"""Pressure and forces from one surface of a body to another, mirror images, and how good a mapping is."""
