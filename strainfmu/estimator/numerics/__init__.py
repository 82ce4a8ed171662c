"""Matrix algebra in the same bits on every processor, splines, and quantised readings."""
