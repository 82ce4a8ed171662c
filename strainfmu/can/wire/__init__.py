"""What is on the wire: frames, CRC, DBC files, signals."""
