"""The variables of every FMU: names, types, units, value references."""
