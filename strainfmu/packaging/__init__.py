"""Packages of an estimator and of a vehicle: FMUs and C sources, and the same as nodes of a CAN bus."""
