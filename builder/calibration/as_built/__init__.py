"""The vehicle as built: what may differ from its drawing, and what its gauges read under pressure and loads."""
