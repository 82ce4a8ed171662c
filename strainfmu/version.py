"""The version of strainfmu, stated here only."""

__version__ = "0.2.0"
