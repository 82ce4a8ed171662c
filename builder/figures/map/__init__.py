"""Figures of a map, first of all of its build report; their marks and cells have values."""
