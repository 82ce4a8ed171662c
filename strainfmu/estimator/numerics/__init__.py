"""Matrix algebra and splines of the estimators, in the same bits on every processor where they must be."""
