"""Frames in: accepted, counted, trusted or not, put together to cycles and decoded to strains."""
