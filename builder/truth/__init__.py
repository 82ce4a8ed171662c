"""The independent model of the vehicle, as built: finer flow and structure than the map's, hardware errors
drawn."""
