"""The bridge on a live bus: strain frames in, load frames out, in real time."""
