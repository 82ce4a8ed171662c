"""The outer shape: meridian, sections along x or any surface, pressure nodes on it, reference quantities."""
