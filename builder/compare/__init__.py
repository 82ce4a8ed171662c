"""Estimators of other kinds beside those of the product, on the same data of the independent model."""
