"""The native kind of FMU: its C sources, their build for every platform, and what is packed."""
