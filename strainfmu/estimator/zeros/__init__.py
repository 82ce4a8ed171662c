"""Zeros of the strain gauges, and how a tare finds them."""
