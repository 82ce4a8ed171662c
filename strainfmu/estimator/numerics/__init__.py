"""Matrix algebra in the same bits on every processor, and splines."""
