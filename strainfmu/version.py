"""The version of strainfmu, stated here only."""

__version__ = "0.1.0"
