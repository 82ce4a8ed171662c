"""The independent model of a vehicle of any shape: a structure of its own mesh, a flow for every flight."""
