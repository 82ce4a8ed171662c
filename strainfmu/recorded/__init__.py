"""Recorded data through the estimator: CSV, HDF5, MAT, MF4, Parquet and TDMS in, CSV or HDF5 out, in blocks."""
