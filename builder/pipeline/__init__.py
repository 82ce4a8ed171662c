"""The stages from a vehicle file to a map and a demonstration, each made once."""
