"""Flows by OpenFOAM to compare with: see docs/evidence/openfoam.md."""
