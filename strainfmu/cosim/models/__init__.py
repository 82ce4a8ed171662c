"""What the FMUs beside the estimator compute, in numpy: plant, autopilot, schedule of commands and faults."""
