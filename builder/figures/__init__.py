"""Figures of pressure, snapshots, structures."""
