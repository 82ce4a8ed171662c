"""Figures of the builder: demonstration, snapshots, structures, build report, reproduction of the source."""
