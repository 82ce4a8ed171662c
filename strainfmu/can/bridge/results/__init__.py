"""Results out: their frames on the bus, composed and sent."""
