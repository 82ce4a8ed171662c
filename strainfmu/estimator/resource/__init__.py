"""``map.bin``, an inverse map as the compiled estimator reads it."""
