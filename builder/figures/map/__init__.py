"""Figures of a map, those of its build report above all: stills, and the same with values under the pointer."""
