"""The Python kind of FMU: run-time sources packed round a slave, and a clean end of its process."""
