"""Figures of a map, those of its build report above all; their marks and cells have values."""
