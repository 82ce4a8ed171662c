"""Covariance of the loads that follow from the states, and the loads beyond the five."""
