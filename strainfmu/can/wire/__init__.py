"""The wire: frames, the signals in them, CRC and counter, profiles and DBC files."""
