"""``map.bin``, an inverse map as the compiled estimator reads it: a container of named arrays."""
