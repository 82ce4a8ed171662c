"""Recorded data through the estimator: CSV, HDF5, MF4, TDMS and CAN logs in, CSV or HDF5 out, block by block."""
