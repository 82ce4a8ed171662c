"""The bridge: strain frames in, load frames out, in real time."""
