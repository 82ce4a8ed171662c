"""Estimates of blocks of recorded samples: by a map or an FMU, filtered or not; the account of their health."""
