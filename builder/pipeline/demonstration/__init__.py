"""The demonstration: from a vehicle file to an FMU in flight, its manoeuvre, scores and pictures."""
