"""What the C run-time reads: ``map.bin`` of an estimator FMU, ``model.bin`` of plant, autopilot and schedule."""
