"""The nonlinear estimator: flight state by Gauss-Newton on tables of strain, then a linear correction."""
