"""Sensors other than the strain gauges: rows of readings per surface pressure, with noise and errors."""
