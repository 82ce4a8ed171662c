"""The independent model of a body of revolution: flows in tables, strain at any flight condition."""
