"""What a map holds for the nonlinear estimator: tables of strain, loads and pressure over the flight state."""
