"""Recorded strains of a file, whatever its format, as blocks of samples."""
