"""The linear estimator: strain and dynamic pressure to loads, with gauges lost, isolation and envelope."""
