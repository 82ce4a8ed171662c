"""Alarm levels: vehicles that fly on the independent model, what they read, quantiles far in the tail."""
