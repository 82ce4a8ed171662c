"""The vehicle: its file, shape, gauges, flight conditions, options of the map."""
