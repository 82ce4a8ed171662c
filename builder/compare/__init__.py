"""Estimators of other kinds than the product's, on the same data of the independent model."""
