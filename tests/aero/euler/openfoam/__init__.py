"""Flows by OpenFOAM to compare with: see docs/explanation/openfoam.md."""
