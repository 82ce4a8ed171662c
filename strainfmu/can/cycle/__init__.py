"""One cycle of the bus: frames assembled, judged, answered."""
