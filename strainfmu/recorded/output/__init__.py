"""What is written: estimates as CSV or HDF5, pressure as VTKHDF; files appear when they are complete."""
