"""The stages from a vehicle file to a map and a demonstration, in memory and from file to file."""
