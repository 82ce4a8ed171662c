"""Placement of gauges: where to put them, how many, and what each one contributes to the loads."""
