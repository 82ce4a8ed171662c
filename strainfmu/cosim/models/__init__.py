"""What the FMUs other than the estimator compute, in numpy: plant, autopilot, schedule of commands and faults."""
