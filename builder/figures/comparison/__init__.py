"""Figures of estimators side by side, and of one under many kinds of error."""
