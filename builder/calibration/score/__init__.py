"""Calibration scored on vehicles and tests drawn at random."""
