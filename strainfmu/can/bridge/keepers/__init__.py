"""What a bridge keeps in files: the freshness value across runs, and the zeros of a tare."""
