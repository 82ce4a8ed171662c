"""Files of every recorder as channels or rows: CSV, MF4, TDMS, HDF5, MAT and Parquet."""
