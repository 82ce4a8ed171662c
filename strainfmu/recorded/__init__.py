"""Recorded data through the estimator: CSV, HDF5, MF4 and TDMS in, CSV or HDF5 out, block by block."""
