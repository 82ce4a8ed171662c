"""What is found of a map and its gauges, as numbers: sources of uncertainty, values, choices, observability."""
