"""Flows by OpenFOAM to compare with: see docs/openfoam.md."""
